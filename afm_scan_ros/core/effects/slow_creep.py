"""Slow creep: springs and dampers in series with the scanner, behind the creep of the model.

x₀ (m) is the displacement without the effect and x the one with it, g is dimensionless, τ in s:

- one time constant: x = x₀ + z, τ dz/dt + z = g x₀.
- logarithmic: several such z with τᵢ twice a decade, which creep with the logarithm of time.
- power (Norton): x = x₀ + g z, dz/dt = e (|e| / r)^(power - 1) / τ, e = x₀ - z. The stress in the
  joint is e, and τ is the time constant at a stress of r, 45 % of the displacement at the largest
  drive. Power 1 is a spring and a damper; dislocations that climb or drag atoms along have 3 to 7.

Cause: glue and clamped joints carry the displacement, with what has crept of it, and creep by all
of that. For the power law x₀ is taken as held between samples. Within a sample period T the stress
then has the closed form e (1 + a s)^(-1/a), with a = power - 1 and s = (T/τ) (|e| / r)^a.
"""

import math
from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled, inlined
from afm_scan_ros.core.effects.base import Element, Recursion
from afm_scan_ros.core.effects.creep import Creep, CreepModel
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures, amounts
from afm_scan_ros.core.effects.scale import length_scale
from afm_scan_ros.core.types import Array

GAIN = EffectParameter("gain", "1", -0.3, 0.5, 1e-5)
FASTEST = EffectParameter("fastest", "s", 1e-3, 1e2, 1e-4, neutral=0.1)
DECADES, PER_DECADE = 5, 2
STEPS = 10.0 ** (np.arange(DECADES * PER_DECADE + 1) / PER_DECADE)
TIME_CONSTANT = EffectParameter("time_constant", "s", 0.05, 1e4, 1e-3, neutral=1.0)
POWER = EffectParameter("power", "1", 1.0, 8.0, 1e-3, neutral=3.0)


REACH = 10e-6
"""Stress r on the reference scanner, m."""
LINEAR = 1e-9
"""Power above 1 below which the law is the linear one."""


@inlined
def _relaxed(stress: float, excess: float, pace: float, unit: float) -> float:
    """Stress (m) after a step, ``pace`` times the time constant at a stress of ``unit`` (m)."""
    if excess < LINEAR:
        return stress * math.exp(-pace)
    fast = pace * (abs(stress) / unit) ** excess
    return stress * math.exp(-math.log1p(excess * fast) / excess)


@compiled
def _run(
    z: float, law: tuple[float, float, float, float], block: Array, direction: float, result: Array
) -> float:
    """From x₀ to x with ``direction`` 1, from x to x₀ with -1; return the last z."""
    gain, excess, pace, unit = law
    for k in range(block.size):
        result[k] = block[k] + direction * gain * z
        still = block[k] if direction > 0.0 else result[k]
        z = still - _relaxed(still - z, excess, pace, unit)
    return z


class NortonCreep(Recursion):
    """Creep by a power of its stress, with its exact inverse; the state is z (m)."""

    def __init__(
        self, gain: float, time_constant: float, power: float, unit: float, period: float
    ) -> None:
        self._law = gain, power - 1.0, period / time_constant, unit

    def at_rest(self) -> float:
        """Nothing has crept."""
        return 0.0

    def run(self, state: float, block: Array, direction: float) -> tuple[float, Array]:
        """What has crept, and displacement (m) with or without it."""
        result = np.empty(len(block))
        return _run(state, self._law, block, direction, result), result


def insert(chain: Chain, values: Array) -> Chain:
    """Put a section behind the creep: gain, time constant (s)."""
    gain, time_constant = values
    return _with_sections(chain, gain, np.array([time_constant]))


def insert_logarithmic(chain: Chain, values: Array) -> Chain:
    """Put sections twice a decade behind it: gain of each, fastest time constant (s)."""
    gain, fastest = values
    return _with_sections(chain, gain, fastest * STEPS)


def insert_power(chain: Chain, values: Array) -> Chain:
    """Put creep by a power of its stress behind it: gain, time constant (s), power."""
    return chain.with_output(Element(NortonCreep, (*values, REACH * length_scale(chain.model))))


def _with_sections(chain: Chain, gain: float, time_constants: Array) -> Chain:
    added = CreepModel(np.full(len(time_constants), gain), time_constants)
    return chain.with_output(Element(Creep, (added,)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """Time constants far below the record's length, below it and beyond, with their gains."""
    for share in (0.01, 0.1, 1.0):
        time_constant = TIME_CONSTANT.nearest(share * features.duration)
        yield _gain(features, np.array([time_constant])), time_constant


def _gain(features: ResidualFeatures, time_constants: Array) -> float:
    """Gain of each of such sections that the residual holds."""
    sections = Creep(
        CreepModel(np.ones(len(time_constants)), time_constants), features.sample_period
    )
    moved = features.displacement
    crept = sections.apply(sections.at_rest(), moved)[1] - moved
    (gain,) = amounts(features.residual, np.asarray(crept))
    return GAIN.nearest(gain)


def starts_logarithmic(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """Creep that begins within a line, a tenth of a second or some seconds, with its gain."""
    for fastest in (0.01, 0.1, 3.0):
        yield _gain(features, fastest * STEPS), fastest


def starts_power(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """A middling power, at the time constants of one section."""
    for gain, time_constant in starts(features):
        yield gain, time_constant, 3.0


FORMS = (
    EffectForm(
        "",
        ("output",),
        (GAIN, TIME_CONSTANT),
        insert,
        starts,
        example=(0.05, 0.3),
        text="one time constant",
    ),
    EffectForm(
        "logarithmic",
        ("output",),
        (GAIN, FASTEST),
        insert_logarithmic,
        starts_logarithmic,
        example=(0.01, 0.05),
    ),
    EffectForm(
        "power",
        ("output",),
        (GAIN, TIME_CONSTANT, POWER),
        insert_power,
        starts_power,
        example=(0.1, 0.05, 3.0),
    ),
)


@register
def slow_creep() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="slow_creep",
        equation="x = x0 + z, time_constant dz/dt + z = gain x0, or one such z for each time"
        " constant from fastest on, twice a decade, or dz/dt = e abs(e / r)^(power - 1) /"
        " time_constant, x = x0 + gain z, e = x0 - z, r 45 % of the displacement at the largest"
        " drive",
        needs="levels held about as long as the time constant, or returned to after it",
        experiment="hold",
        remedy="feedforward",
        advice="the inverse counts from the scan's start: rest as long before it as creep lasts",
        source="D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123 (2001) 35, Eq. 1;"
        " H. J. Frost and M. F. Ashby, Deformation-Mechanism Maps, Pergamon 1982, section 2.4.",
        inverse="Each step of the sampled system is solved for its input, so the inverse is exact.",
        forms=FORMS,
    )
