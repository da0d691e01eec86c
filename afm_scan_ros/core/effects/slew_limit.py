"""Slew limit: the voltage on the piezo cannot follow a drive steeper than the amplifier's slope.

Before the hysteresis, with the drive u and the voltage v in V and the slope S in V/s:

- even: dv/dt = ± S until v = u.
- uneven: another S falling than rising, where the amplifier sinks less current than it sources.
- resistive: S - v/τ rising and S + v/τ falling, 1/τ being the rate. A resistance bounds the
  current, which is smaller the nearer v is to the supply.

Cause: the amplifier's limited current into the piezo's capacitance. The hysteresis takes v as held
between updates. So it gets the mean of v over each hold, which is exact for all that is slow beside
the sample period.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import CausalInverse, Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.errors import SampleError
from afm_scan_ros.core.types import Array

WAYS = ("rising", "falling")
SLOPE = EffectParameter("slope", "V/s", 1.0, 1e11, 0.01, neutral=1e11)
RISING, FALLING = (evolve(SLOPE, name=f"{way}_slope") for way in WAYS)
RATE = EffectParameter("rate", "1/s", 0.0, 1e4, 1e-3)
ROUNDING = 1e-9
SHARES = (0.9, 0.75, 0.6, 0.45, 0.3, 0.15)
LEAST = 1e-12  # V in a hold
BEYOND = 3.0
"""Slope of the way that is not limited, over the drive's steepest."""
STEEPEST = 0.999
"""Share of the moving drive that is less steep than what counts as its steepest."""


@compiled
def _apply(end: float, law: tuple[float, float, float], block: Array, result: Array) -> float:
    """``law``: what the voltage may rise and fall in a hold, V, and the share of v it loses."""
    up, down, share = law
    for k in range(block.size):
        missing = block[k] - end
        room = up - share * end if missing > 0.0 else down + share * end
        room = max(room, LEAST)
        if abs(missing) <= room:
            result[k] = block[k] - 0.5 * missing * abs(missing) / room
            end = block[k]
        else:
            step = room if missing > 0.0 else -room
            result[k] = end + 0.5 * step
            end += step
    return end


class SlewLimit(CausalInverse):
    """Limits of rising and falling (V/s), of which each volt takes and gives a ``rate`` (1/s).

    The state is the voltage at the last hold's end (V). Where the slope suffices, v still comes
    late by the time it takes to each update's step. The inverse adds that, exact on ramps, and
    raises SampleError for what is too steep. Its state is the last target (V).
    """

    def __init__(self, rising: float, falling: float, rate: float, sample_period: float) -> None:
        self._period = sample_period
        self._law = rising * sample_period, falling * sample_period, rate * sample_period

    def at_rest(self) -> float:
        """Voltage of a scanner that has long rested at zero."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        result = np.empty_like(block)
        return _apply(state, self._law, block, result), result

    def invert(self, state: float, block: Array) -> tuple[float, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        rise, before = np.diff(block, prepend=state), np.r_[state, block][:-1]
        up, down, share = self._law
        room = np.where(rise > 0.0, up - share * before, down + share * before)
        room = np.maximum(room, LEAST)
        bad = ~(np.abs(rise) <= (1.0 + ROUNDING) * room)
        if bad.any():
            k = int(np.argmax(bad))
            raise SampleError(
                k,
                f"the drive would need {rise[k] / self._period:.6g} V/s, beyond the model's slew"
                f" limit of {room[k] / self._period:.6g} V/s: scan a smaller range or more slowly,"
                " or give turnaround and y step more time",
            )
        last = float(block[-1]) if len(block) else state
        return last, block + 0.5 * rise * np.abs(rise) / room


def insert(chain: Chain, values: Array) -> Chain:
    """Limit the drive's slope (V/s), or rise and fall apart, or these and their rate (1/s)."""
    rising, falling, rate = (*values, 0.0)[:3] if len(values) > 1 else (*values, *values, 0.0)
    return chain.with_drive(Element(SlewLimit, (rising, falling, rate)))


def starts(features: ResidualFeatures) -> Iterator[tuple[float]]:
    """Slopes below the drive's steepest: a limit that most of it exceeded would stop the scan."""
    steepest = _steepest(features)
    for share in SHARES:
        yield (SLOPE.nearest(share * steepest),)


def starts_uneven(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """The same to one side, and to the other what hardly limits."""
    free = SLOPE.nearest(BEYOND * _steepest(features))
    for (limited,) in starts(features):
        yield free, limited
        yield limited, free


def starts_resistive(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """The same, at any voltage."""
    for rising, falling in starts_uneven(features):
        yield rising, falling, 0.0


def _steepest(features: ResidualFeatures) -> float:
    slopes = np.abs(np.diff(features.drive)) / features.sample_period
    moving = slopes[slopes > 0.0]
    return float(np.quantile(moving, STEEPEST)) if moving.size else SLOPE.upper


@register
def slew_limit() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="slew_limit",
        equation="dv/dt = +-slope until v = u, or +rising_slope and -falling_slope,"
        " or rising_slope - rate v and -falling_slope - rate v",
        needs="drives steeper than the limit; one that never exceeds it only bounds it from below",
        experiment="rates",
        remedy="partly",
        advice="above the limit the inverse refuses: scan more slowly, lengthen turnaround and y"
        " step, or give the amplifier more current",
        source="Current limit of a piezo amplifier: A. J. Fleming and K. K. Leang, Design, Modeling"
        " and Control of Nanopositioning Systems, Springer 2014.",
        inverse="A target that asks for more than the limit raises an error that names sample,"
        " slope and limit; nothing is clipped.",
        forms=(
            EffectForm("", ("drive",), (SLOPE,), insert, starts, example=(2e3,), text="even"),
            EffectForm(
                "uneven",
                ("drive",),
                (RISING, FALLING),
                insert,
                starts_uneven,
                example=(2e3, 3e3),
                refines="",
            ),
            EffectForm(
                "resistive",
                ("drive",),
                (RISING, FALLING, RATE),
                insert,
                starts_resistive,
                example=(2e3, 3e3, 20.0),
                refines="",
            ),
        ),
    )
