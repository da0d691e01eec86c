"""Checks of a vibration model on its frequency record: other descriptions, delay, amplitude."""

from collections.abc import Iterator, Mapping

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.alternating import EDGE, REFERENCE_GAIN, Converged
from afm_scan_ros.core.identification.alternatives import alternatives
from afm_scan_ros.core.identification.findings import Finding, UnmodelledDelay
from afm_scan_ros.core.identification.vibration.delay import RecordDelay, record_delay
from afm_scan_ros.core.identification.vibration.frequency_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.order_selection import OrderChoice
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational

NOTABLE = 0.014
"""Phase (rad) at the resonance from which on a delay matters: 0.8 degrees, 5 µs at 450 Hz."""
MISFITS = 3.0
"""Misfits of the vibration model within which the delay's must lie for it to be identified."""


@frozen
class VibrationChecks:
    """Checks of one axis' vibration; ``delay`` is how late its frequency record is."""

    alternatives: Mapping[str, RationalFit]
    """Fits under other descriptions of the records, by what differs."""
    at_zero: RationalFit | None
    """Fit to the response to the drive u at zero amplitude, where the record allows it."""
    orders: OrderChoice | None
    """Orders tried, where one was to be chosen."""
    delay: RecordDelay

    def identifies_delay(self, fit: RationalFit) -> bool:
        """Whether the model that shows the delay fits the scanner about as well as ``fit``."""
        return self.delay.misfit <= MISFITS * fit.misfit

    def delay_findings(self, fit: RationalFit) -> Iterator[Finding]:
        """Yield a delay of the record beyond that of ``fit``, where there is one."""
        taken = fit.model.delay
        beyond, (low, high) = self.delay.delay - taken, self.delay.interval
        notable = NOTABLE / (2.0 * np.pi * fit.resonance)
        if self.identifies_delay(fit) and abs(beyond) > notable and not low <= taken <= high:
            yield UnmodelledDelay(beyond, (low - taken, high - taken))


def check_vibration(converged: Converged, at_zero: FrequencyResponse | None) -> VibrationChecks:
    """Check what was settled on; ``at_zero`` is the response to u at zero amplitude."""
    period, fit = converged.turns.frequency.sample_period, converged.turn.vibration
    zero = None
    if at_zero is not None:
        early = at_zero.advanced(fit.model.delay).up_to(fit.band[1] * (1.0 + EDGE))
        zero = fit_rational(early, period, REFERENCE_GAIN, fit.order)
    return VibrationChecks(
        alternatives=alternatives(converged),
        at_zero=zero,
        orders=converged.turns.orders,
        delay=record_delay(converged.turn.response, period, fit.resonance),
    )
