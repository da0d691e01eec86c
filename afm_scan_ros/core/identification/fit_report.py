"""How well one axis was fitted: checks of its models, and figures of merit on held-out data.

Preisach's operator and Duhem's are both fitted to the reversal curves. The whole model with either
predicts the displacement of what fitted nothing: the loops after the curves, else the record for
validation. Duhem's is chosen where it is better by the test of ``is_better``.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.agreement import loops_after
from afm_scan_ros.core.identification.alternating import (
    REFERENCE_GAIN,
    AxisRecord,
    Converged,
    with_duhem,
)
from afm_scan_ros.core.identification.creep.fit import CreepFit
from afm_scan_ros.core.identification.findings import (
    Finding,
    GainMismatch,
    InexactDirectInverse,
    InexactInverse,
    MisfitCause,
    OpenLoops,
    ResponseMisfit,
    UnmodelledDelay,
)
from afm_scan_ros.core.identification.hysteresis.duhem_fit import fit_duhem
from afm_scan_ros.core.identification.hysteresis.reversal_curves import is_better
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.identification.statuses import alternatives
from afm_scan_ros.core.identification.validation import residual_of
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit, fit_rational
from afm_scan_ros.core.identification.vibration.structure import (
    OrderChoice,
    RecordDelay,
    record_delay,
)
from afm_scan_ros.core.model import AxisModel, CreepModel
from afm_scan_ros.core.types import Array

PREISACH, DUHEM = "preisach", "duhem"


@frozen
class OperatorChoice:
    """Residual (m) of the model with either operator on a held-out ``record``."""

    record: str
    preisach: Misfit
    duhem: Misfit
    chosen: str


def choose_operator(
    converged: Converged, creep: CreepModel, hysteresis: AxisRecord, validation: AxisRecord | None
) -> tuple[Converged, OperatorChoice | None]:
    """Return what settles with the better operator; without held-out data Preisach's stays.

    Raises ScanError where Duhem's is better and does not settle with the vibration.
    """
    curves = converged.turns.curves
    name, record, first = "hysteresis, the loops after its curves", hysteresis, curves.end
    if not loops_after(hysteresis, curves):
        if validation is None:
            return converged, None
        name, record, first = "validation", validation, 0
    drive, effective = hysteresis.drive[: curves.end], converged.turn.effective[: curves.end]
    try:
        slopes = fit_duhem(drive, effective)
    except (InputError, np.linalg.LinAlgError):  # there is no hysteresis, or too few branches
        return converged, None
    tried = evolve(converged, slopes=slopes)
    preisach, duhem = (_left(each, creep, record)[first:] for each in (converged, tried))
    better = is_better(duhem, preisach, record.drive[first:])
    chosen = DUHEM if better else PREISACH
    choice = OperatorChoice(name, misfit(preisach), misfit(duhem), chosen)
    return (with_duhem(converged, slopes) if better else converged), choice


def _left(converged: Converged, creep: CreepModel, record: AxisRecord) -> Array:
    model = AxisModel(converged.hysteresis, converged.turn.vibration.model, creep)
    return residual_of(model, record)


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
        early = at_zero.advanced(fit.model.delay).up_to(fit.band[1])
        zero = fit_rational(early, period, REFERENCE_GAIN, fit.order)
    return VibrationChecks(
        alternatives=alternatives(converged),
        at_zero=zero,
        orders=converged.turns.orders,
        delay=record_delay(converged.turn.response, period, fit.resonance),
    )


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
