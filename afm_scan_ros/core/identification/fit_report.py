"""How well one axis was fitted, with the paper's figures of merit on held-out data."""

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.findings import (
    Finding,
    GainMismatch,
    InexactDirectInverse,
    InexactInverse,
    MisfitCause,
    OpenLoops,
    ResponseMisfit,
)
from afm_scan_ros.core.identification.operator_choice import DUHEM, OperatorChoice
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.identification.vibration.checks import VibrationChecks
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit

EXACT_SIGMA, EXACT_MAXIMUM = 0.001, 0.003
"""Shares of the drive's range that the exact inverse should keep to."""
DIRECT_SIGMA, DIRECT_MAXIMUM = 0.0416, 0.118
"""V of 8 V: the paper's direct inverse (Eqs. 18, 19)."""
CLOSURE = 2e-3
"""Share of F's range by which returns to saturation may differ."""
VIBRATION_MISFIT = 0.01
UNEXPLAINED = 2.0
"""Misfit over what noise and nonlinearity account for, beyond which the model is too small."""
GAIN_MISMATCH = 0.1


@frozen
class AxisReport:
    """What was fitted on what, and how well. Misfits of creep in m, of hysteresis in V of drive."""

    creep: CreepFit
    vibration: RationalFit
    """Its intervals span the alternatives that are checked."""
    checks: VibrationChecks
    exact: Misfit | None
    """Exact inversion of the forward surface, on the held-out loops (Eqs. 18, 19).

    None where no loops follow the reversal curves.
    """
    direct: Misfit | None
    """The paper's direct inverse on the same loops."""
    operator: OperatorChoice | None
    """Preisach's operator or Duhem's; None where nothing is held out to choose by."""
    drive_range: float
    """Peak-to-peak drive of the hysteresis record, V."""
    effective_range: float
    """Range of F, V."""
    closure: float
    """Difference of F among the returns to negative saturation, V."""
    rounds: int
    """Turns that hysteresis and vibration took."""
    change: float
    """Largest change of the hysteresis in the last of them, over F's range."""
    records: tuple[Finding, ...]
    """Where a record contradicts the others."""

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What a user should know before trusting the model."""
        late = self.checks.delay_findings(self.vibration)
        vibration = (*self.vibration.warnings, *late, *self._of_vibration())
        return (*self.records, *self.creep.warnings, *vibration, *self._of_hysteresis())

    def _of_hysteresis(self) -> Iterator[Finding]:
        if self.exact is not None:
            sigma, maximum = (
                error / self.drive_range for error in (self.exact.sigma, self.exact.maximum)
            )
            if sigma > EXACT_SIGMA or maximum > EXACT_MAXIMUM:
                yield InexactInverse(sigma, maximum)
        if self.operator is not None and self.operator.chosen == DUHEM:
            return  # whose loops need not close; it is not inverted directly
        if self.direct is not None:
            sigma, maximum = self.direct.sigma, self.direct.maximum
            scale = self.drive_range / 8.0
            if sigma > DIRECT_SIGMA * scale or maximum > DIRECT_MAXIMUM * scale:
                yield InexactDirectInverse(sigma, maximum, DIRECT_SIGMA, DIRECT_MAXIMUM)
        if self.closure > CLOSURE * self.effective_range:
            yield OpenLoops(self.closure)

    def _of_vibration(self) -> Iterator[Finding]:
        fit = self.vibration
        if fit.misfit > VIBRATION_MISFIT:
            yield ResponseMisfit(fit.misfit, fit.band, *_cause(fit))
        if abs(fit.gain_ratio - 1.0) > GAIN_MISMATCH:
            yield GainMismatch(fit.gain_ratio)


def _cause(fit: RationalFit) -> tuple[MisfitCause, float]:
    """Return what most of a misfit to the response is due to, and its share of the response."""
    if fit.misfit > UNEXPLAINED * np.hypot(fit.noise_share, fit.nonlinearity_share):
        return MisfitCause.MODES, fit.misfit
    if fit.noise_share > fit.nonlinearity_share:
        return MisfitCause.NOISE, fit.noise_share
    return MisfitCause.NONLINEARITY, fit.nonlinearity_share
