"""Rate-dependent hysteresis: the domains need time to follow.

R is the reversible part of the model's hysteresis and H the rest; u, w and F are in V, τ is in s:

- one lag: F = R(u) + H(w), τ dw/dt + w = u. H sees the drive late. Slow beside 1/τ nothing changes.
  At higher rates the loops lean over and open, and peaks that are too short leave no memory.
- film: the hysteresis is a sum of plays, each of which drags a block through a viscous film.
  τ dp/dt is what of u - p lies beyond the threshold ± r.
- activated: τ dp/dt = ± a (e^{|e|/a} - 1), with a in V, and e what lies beyond the threshold. Heat
  helps over the barriers, so at a steady rate v a block lags by a ln(1 + v τ / a).

Cause: the viscosity of hysteresis. What follows gets the mean over each hold, so w is the drive
behind an input_lag. The film is in viscous_plays.py.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.effects.base import CausalInverse, Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, reversible
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach
from afm_scan_ros.core.effects.hysteresis.walk import (
    INPUT,
    OUTPUT,
    Surface,
    cell,
    looked_up,
    try_input,
)
from afm_scan_ros.core.effects.lti import mean_over_holds, pole_of
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.viscous_plays import (
    EXACT,
    ROUNDS,
    ViscousPlays,
    halley,
    next_try,
    refuse_unsolved,
)
from afm_scan_ros.core.types import Array

LAG = EffectParameter("lag", "s", 0.0, 1.0, 1e-7)
ACTIVATION = EffectParameter("activation", "V", 1e-4, 4.0, 1e-6, neutral=1e-2)
State = tuple[Memory, Array]


@inlined
def _straight(surface: Surface, at: float, levels: Array) -> tuple[float, float]:
    """R at an input (V), and its slope."""
    _, axes, bins = surface
    i = cell(axes, bins, 0, at)
    slope = axes[2, i] * (levels[i + 1] - levels[i])
    return levels[i] + (at - axes[0, i]) * slope, slope


@inlined
def _tried(
    u: float,
    surface: tuple[Surface, Array],
    memory: tuple[Array, int, Array],
    late: tuple[float, float],
) -> tuple[float, float, tuple[int, float, float]]:
    """F for u, its slope, and what follows: depth of the memory, w and P(w)."""
    (loops, levels), (stack, depth, now), (share, end) = surface, memory, late
    w = u + share * (end - u)
    depth, whole, per = try_input(loops, (stack, depth), now, w)
    (at_u, per_u), (at_w, per_w) = _straight(loops, u, levels), _straight(loops, w, levels)
    slope = per_u + (1.0 - share) * (per - per_w)
    return at_u + whole - at_w, slope, (depth, w, whole)


@compiled
def _invert(
    surface: tuple[Surface, Array],
    memory: tuple[Array, int, Array],
    lag: tuple[float, float, float],
    block: Array,
    result: Array,
) -> tuple[int, float, int]:
    """Return depth, voltage at the last hold's end, and how many samples were within range."""
    (_, axes, _), levels = surface
    (stack, depth, now), (mean_share, end_share, end) = memory, lag
    bounds, height = (axes[0, 0], axes[0, -1]), levels[-1] - levels[0]
    u = end
    for k in range(block.size):
        tried, past, late = bounds, (stack, depth, now), (mean_share, end)
        for _ in range(ROUNDS):  # F is straight in each cell
            forced, slope, turned = _tried(u, surface, past, late)
            miss = forced - block[k]
            if abs(miss) <= EXACT * height:
                break
            tried = (tried[0], u) if miss > 0.0 else (u, tried[1])
            there = next_try(u, halley(miss, slope, 0.0), tried, bounds)
            if there == u:
                result[k] = block[k] + miss  # what is within reach now
                return depth, end, k
            u = there
        if not abs(miss) <= EXACT * height:
            result[k] = np.nan
            return depth, end, k
        result[k], end = u, u + end_share * (end - u)
        depth, now[INPUT], now[OUTPUT] = turned
    return depth, end, block.size


class RateDependentHysteresis(CausalInverse):
    """Preisach hysteresis whose part with memory sees the drive late; state: Memory and lag (V)."""

    def __init__(self, surface: EverettSurface, lag: float, sample_period: float) -> None:
        self._lag = mean_over_holds(pole_of(lag), sample_period)
        self._preisach = Preisach(surface)
        self._levels = reversible(surface)
        self._surface = looked_up(surface.values, surface.levels), self._levels

    def at_rest(self) -> State:
        """State of a scanner that was depolarised and has long rested at zero."""
        return self._preisach.at_rest(), self._lag.at_rest()

    def apply(self, state: State, block: Array) -> tuple[State, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        self._preisach.surface.refuse_other_inputs(block)
        end, late = self._lag.apply(state[1], block)
        memory, forced = self._preisach.apply(state[0], late)
        return (memory, end), forced + self._straight(block) - self._straight(late)

    def invert(self, state: State, block: Array) -> tuple[State, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        memory = state[0]
        stack = np.hstack((memory.extrema, np.empty((2, len(block)))))
        now, result = memory.now.copy(), np.empty_like(block)
        depth, end, found = _invert(
            self._surface,
            (stack, memory.extrema.shape[1], now),
            (float(self._lag.c[0]), float(self._lag.a[0, 0]), float(state[1][0])),
            block,
            result,
        )
        refuse_unsolved(found, block, result)
        self._preisach.surface.refuse_other_inputs(result)
        return (Memory((stack[:, :depth].copy(),), now), np.array([end])), result

    def _straight(self, inputs: Array) -> Array:
        return np.interp(inputs, self._preisach.surface.levels, self._levels)


def insert(chain: Chain, values: Array) -> Chain:
    """Let the part of the hysteresis that has memory see the drive late by a time in s."""
    return chain.with_hysteresis(Element(RateDependentHysteresis, tuple(values)))


def _film(surface: EverettSurface, *values: float) -> ViscousPlays:
    """Return plays in a film for its values and, as the last argument, the sample period (s)."""
    lag, *activation, sample_period = values
    return ViscousPlays(surface, lag, sample_period, *activation)


def insert_film(chain: Chain, values: Array) -> Chain:
    """Let a film hold back the blocks: time constant (s) and, where heat helps, activation (V)."""
    return chain.with_hysteresis(Element(_film, tuple(values)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float]]:
    """Lags from some samples to a good part of the record."""
    for lag in (3.0 * features.sample_period, 1e-3, 1e-2, 0.05 * features.duration):
        yield (LAG.nearest(lag),)


def starts_activated(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """A short and a long time, and a pull as of a small part of a loop."""
    for lag in (10.0, 100.0):
        yield LAG.nearest(lag * features.sample_period), 1e-2


@register
def rate_dependent_hysteresis() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="rate_dependent_hysteresis",
        equation="F = R(u) + H(w), lag dw/dt + w = u, R + H the model's hysteresis, or each play of"
        " it dragged through a film, lag dp/dt = what of u - p lies beyond +-r, e, or helped by"
        " heat, lag dp/dt = activation (exp(e / activation) - 1)",
        needs="loops of one amplitude at very different rates",
        experiment="rates",
        remedy="feedforward",
        advice="the exact inverse undoes it, the direct one does not know it",
        source="I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer 1991; M. Goldfarb and"
        " N. Celanovic, IEEE Control Systems 17 (1997) 69; L. Prandtl, ZAMM 8 (1928) 85.",
        inverse="F grows with u on every branch, so each sample is one equation in one unknown,"
        " solved between its bounds: the inverse is exact. With a film the equation sums over all"
        " plays (`afm-scan bench speed_inverses` prints the time).",
        confusable=("slow_creep",),
        forms=(
            EffectForm(
                "", ("hysteresis",), (LAG,), insert, starts, example=(2e-4,), text="one lag"
            ),
            EffectForm(
                "film", ("hysteresis",), (LAG,), insert_film, starts, example=(2e-4,), refines=""
            ),
            EffectForm(
                "activated",
                ("hysteresis",),
                (LAG, ACTIVATION),
                insert_film,
                starts_activated,
                example=(2e-4, 0.02),
                refines="",
            ),
        ),
    )
