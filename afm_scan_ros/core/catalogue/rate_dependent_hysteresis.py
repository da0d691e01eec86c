"""Rate-dependent hysteresis: the domains need time to follow.

Equation: F = R(u) + L H(u), with R the reversible part of the hysteresis, H the rest, and L a
first-order lag by τ (s): at rates slow beside 1/τ nothing changes, at fast ones the loops thin
out. u and F in V. As before, what follows gets the lagged part's mean over each hold T:

    F[k] = R[k] + (1 - m) H[k] + m q[k-1],    q[k] = (1 - a) H[k] + a q[k-1]

with m and a those of input_lag. So F - m q is itself a Preisach model, of the share 1 - m of H,
and the inverse is one walk on its surface. Rate-dependent models of the Preisach kind are
Mayergoyz's, Mathematical Models of Hysteresis (1991), of the play kind Al Janaideh's; this one is
the simplest that has one parameter.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.catalogue.input_lag import InputLag, held_lag
from afm_scan_ros.core.catalogue.reversible import reversible, with_hysteretic_share
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach
from afm_scan_ros.core.effects.hysteresis.walk import drive
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

LAG = Parameter("lag", "s", 0.0, 1.0, 1e-7)
State = tuple[Memory, float]


@compiled
def _invert(
    tables: Array,
    grid: tuple[float, float, Array],
    lag: tuple[float, float, float],
    memory: tuple[Array, Array, int],
    block: Array,
    targets: Array,
    result: Array,
) -> tuple[int, float]:
    lower, step, levels = grid
    mean_share, end_share, lagged = lag
    stack, now, depth = memory
    for k in range(block.size):
        targets[k] = block[k] - mean_share * lagged
        one = slice(k, k + 1)
        depth = drive(tables, (lower, step), stack, depth, now, targets[one], result[one])
        place = (result[k] - lower) / step
        i = min(max(int(place), 0), levels.size - 2)
        straight = levels[i] + (place - i) * (levels[i + 1] - levels[i])
        rest = (targets[k] - straight) / (1.0 - mean_share)
        lagged = rest + end_share * (lagged - rest)
    return depth, lagged


class RateDependentHysteresis:
    """Preisach hysteresis of which the part with memory lags; the state is Memory and q (V).

    Its inverse is exact. That one's Memory is of the surface it walks on.
    """

    def __init__(self, surface: EverettSurface, lag: float, sample_period: float) -> None:
        self._shares = held_lag(lag, sample_period)
        self._lag = InputLag(lag, sample_period)
        self._now = Preisach(surface)
        self._walked = Preisach(with_hysteretic_share(surface, 1.0 - self._shares[0]))
        self._levels = reversible(surface)

    def at_rest(self) -> State:
        """State of a scanner that was depolarised and has long rested at zero."""
        memory = self._now.at_rest()
        return memory, float(memory.now[1] - self._straight(memory.now[:1])[0])

    def apply(self, state: State, block: Array) -> tuple[State, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        memory, forced = self._now.apply(state[0], block)
        straight = self._straight(block)
        lagged, rest = self._lag.apply(state[1], forced - straight)
        return (memory, lagged), straight + rest

    def inverse_at_rest(self) -> State:
        """State of the inverse: the same material, depolarised."""
        return self._walked.at_rest(), self.at_rest()[1]

    def invert(self, state: State, block: Array) -> tuple[State, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        memory, surface = state[0], self._walked.surface
        stack = np.hstack((memory.extrema, np.empty((2, len(block)))))
        now, targets, result = memory.now.copy(), np.empty_like(block), np.empty_like(block)
        depth, lagged = _invert(
            np.stack((surface.values.T, surface.values[::-1, ::-1])),
            (surface.lower, float(surface.levels[1] - surface.levels[0]), self._levels),
            (*self._shares, state[1]),
            (stack, now, memory.extrema.shape[1]),
            block,
            targets,
            result,
        )
        refuse_beyond(targets, surface.output_lower, surface.output_upper)
        return (Memory(stack[:, :depth].copy(), now), lagged), result

    def finish(self, state: State) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)

    def _straight(self, inputs: Array) -> Array:
        return np.interp(inputs, self._now.surface.levels, self._levels)


def insert(chain: Chain, values: Array) -> Chain:
    """Let the part of the hysteresis that has memory lag by a time in s."""
    (lag,) = values
    return evolve(
        chain, hysteresis=lambda surface, period: RateDependentHysteresis(surface, lag, period)
    )


def starts(clues: Clues) -> Iterator[tuple[float]]:
    """Lags from some samples to a good part of the record."""
    for lag in (3.0 * clues.sample_period, 1e-3, 1e-2, 0.05 * clues.duration):
        yield (LAG.nearest(lag),)


ENTRY = Entry(
    name="rate_dependent_hysteresis",
    equation="F = R(u) + H(u) / (1 + s lag), R + H the model's hysteresis",
    needs="loops of one amplitude at very different rates",
    confusable=("delay", "input_lag", "parameter_shift", "slow_creep"),
    experiment="rates",
    remedy="feedforward",
    advice="the exact inverse undoes it, the direct one does not know it",
    forms=(Form("", (LAG,), insert, starts, (0.0,)),),
)
