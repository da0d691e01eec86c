"""What else a frequency record tells of a vibration model: other descriptions, delay, amplitude."""

from collections.abc import Iterator, Mapping

from attrs import frozen

from afm_scan_ros.core.identification.alternating import (
    HIGHEST,
    REFERENCE_GAIN,
    AxisRecord,
    Converged,
)
from afm_scan_ros.core.identification.alternatives import alternatives
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurves
from afm_scan_ros.core.identification.vibration.delay import RecordDelay, record_delay
from afm_scan_ros.core.identification.vibration.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.order_selection import OrderChoice
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational
from afm_scan_ros.core.types import Array

NOTABLE = 5e-6
"""s from which on a delay matters: it is 0.8 degrees at 450 Hz."""
MISFITS = 3.0
"""Misfits of the vibration model within which the delay's must keep for it to be told."""


@frozen
class VibrationChecks:
    """Checks of one axis' vibration; ``delay`` is how late its frequency record is."""

    alternatives: Mapping[str, RationalFit]
    """Fits under other descriptions of the records, by what differs."""
    at_zero: RationalFit | None
    """Fit to the response to the drive u at zero amplitude, where the record can tell it."""
    orders: OrderChoice | None
    """Orders tried, where one was to be chosen."""
    delay: RecordDelay

    def tells_delay(self, fit: RationalFit) -> bool:
        """Whether the model that shows the delay fits the scanner about as well as ``fit``."""
        return self.delay.misfit <= MISFITS * fit.misfit

    def delay_warnings(self, fit: RationalFit) -> Iterator[str]:
        """Say that the record is late, or early, beyond what ``fit`` has taken for its own."""
        taken = fit.model.delay
        beyond, (low, high) = self.delay.delay - taken, self.delay.interval
        if not self.tells_delay(fit) or abs(beyond) <= NOTABLE or low <= taken <= high:
            return
        verb, mend = ("lags", ", or identify with --delay") if beyond > 0.0 else ("leads", "")
        ends = sorted(abs(end - taken) for end in self.delay.interval)
        yield (
            f"the frequency record {verb} by {_micro(abs(beyond))} µs beyond the model (95 % from"
            f" {_micro(ends[0])} to {_micro(ends[1])}): sample drive and displacement on one"
            f" clock{mend}"
        )


def check_vibration(
    converged: Converged,
    drive: Array,
    frequency: AxisRecord,
    curves: ReversalCurves,
    at_zero: FrequencyResponse | None,
) -> VibrationChecks:
    """Check what was settled on.

    ``drive`` (V, (n,)) is the hysteresis record's, ``frequency`` is freed of creep, ``at_zero`` its
    response to u at zero amplitude.
    """
    period, fit = frequency.sample_period, converged.vibration
    zero = None
    if at_zero is not None:
        early = at_zero.advanced(fit.model.delay)
        zero = fit_rational(early, period, REFERENCE_GAIN, HIGHEST, fit.order)
    return VibrationChecks(
        alternatives=alternatives(converged, drive, frequency, curves),
        at_zero=zero,
        orders=converged.orders,
        delay=record_delay(converged.response, period, HIGHEST),
    )


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.1f}"
