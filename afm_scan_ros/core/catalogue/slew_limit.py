"""Slew limit: the voltage on the piezo cannot follow a drive steeper than the amplifier's slope.

Equation: dv/dt = ± S until v = u, before the hysteresis; S in V/s. Source: the amplifier's current
into the piezo's capacitance. What follows takes v as held between updates, so it gets v's mean
over each hold, which is exact for all that is slow beside the sample period T.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

SLOPE = Parameter("slope", "V/s", 1.0, 1e11, 0.01)
ROUNDING = 1e-9
STEEPEST = 0.999
"""Share of the moving drive that is less steep than what counts as its steepest."""


class TooSteepError(ScanError):
    """A target asks for more than the slew limit allows.

    ``sample`` (index in the block), ``value`` and ``limit`` (V/s) are for whoever knows which axis
    and which scan that was.
    """

    def __init__(self, sample: int, value: float, limit: float) -> None:
        super().__init__(
            f"sample {sample} of the block asks for a drive of {value:.6g} V/s, beyond the"
            f" model's slew limit of {limit:.6g} V/s: scan a smaller range or more slowly, or give"
            " turnaround and y step more time"
        )
        self.sample = sample
        self.value = value
        self.limit = limit


@compiled
def _apply(end: float, room: float, block: Array, result: Array) -> float:
    for k in range(block.size):
        missing = block[k] - end
        if abs(missing) <= room:
            result[k] = block[k] - 0.5 * missing * abs(missing) / room
            end = block[k]
        else:
            step = room if missing > 0.0 else -room
            result[k] = end + 0.5 * step
            end += step
    return end


class SlewLimit:
    """Limit of one slope (V/s); the state is the voltage at the last hold's end (V).

    Where the slope suffices, v still comes late by the time it takes to each update's step. The
    inverse adds that, exact on ramps. What is too steep no inverse can reach: it raises
    TooSteepError. Its state is the last target (V).
    """

    def __init__(self, slope: float, sample_period: float) -> None:
        self._slope = slope
        self._period = sample_period
        self._room = slope * sample_period

    def at_rest(self) -> float:
        """Voltage of a scanner that has long rested at zero."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        result = np.empty_like(block)
        return _apply(state, self._room, block, result), result

    def inverse_at_rest(self) -> float:
        """Target at rest."""
        return 0.0

    def invert(self, state: float, block: Array) -> tuple[float, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        rise = np.diff(block, prepend=state)
        bad = ~(np.abs(rise) <= (1.0 + ROUNDING) * self._room)
        if bad.any():
            sample = int(np.argmax(bad))
            raise TooSteepError(sample, float(rise[sample]) / self._period, self._slope)
        last = float(block[-1]) if len(block) else state
        return last, block + 0.5 * rise * np.abs(rise) / self._room

    def finish(self, state: float) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


def insert(chain: Chain, values: Array) -> Chain:
    """Limit the slope of the drive, in V/s."""
    (slope,) = values
    return chain.with_drive(lambda period: SlewLimit(slope, period))


def starts(clues: Clues) -> Iterator[tuple[float]]:
    """Slopes below the drive's steepest: a limit that most of it exceeded would stop the scan."""
    slopes = np.abs(np.diff(clues.drive)) / clues.sample_period
    moving = slopes[slopes > 0.0]
    steepest = np.quantile(moving, STEEPEST) if moving.size else SLOPE.upper
    for share in (0.9, 0.75, 0.6, 0.45, 0.3, 0.15):
        yield (SLOPE.nearest(share * steepest),)


ENTRY = Entry(
    name="slew_limit",
    equation="dv/dt = +-slope until v = u",
    needs="drives steeper than the limit; one that never exceeds it only bounds it from below",
    confusable=("input_lag",),
    experiment="rates",
    remedy="partly",
    advice="below the limit nothing is lost; above it the inverse refuses: scan more slowly, or"
    " lengthen turnaround and y step, or give the amplifier more current",
    forms=(Form("", (SLOPE,), insert, starts, (SLOPE.upper,)),),
)
