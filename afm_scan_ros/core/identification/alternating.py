"""Hysteresis and vibration of one axis, identified in turns.

The hysteresis record must be freed of the vibration's delay, and the frequency response is that
to F = H(u): each needs the other. The first round takes the vibration for its gain at rest; every
next one starts from the vibration just found, until the Everett surface rests. The ramps being
slow, a round shrinks the change some hundredfold.
"""

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge

from afm_scan_ros.core.effects.base import AnyEffect
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import InverseDesign, Vibration
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.hysteresis.everett_fit import (
    LEVELS,
    EverettFit,
    fit_everett,
    fit_forward,
    terms_that_serve,
)
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import FittedSurface
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurves
from afm_scan_ros.core.identification.records.recording import CalibrationRecord
from afm_scan_ros.core.identification.vibration.delay import record_delay
from afm_scan_ros.core.identification.vibration.frequency_response import (
    FrequencyResponse,
    frequency_response,
)
from afm_scan_ros.core.identification.vibration.order_selection import OrderChoice, choose_order
from afm_scan_ros.core.identification.vibration.periodic import record_spectra
from afm_scan_ros.core.identification.vibration.rational_fit import (
    PAPER,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.paper import VIBRATION_X
from afm_scan_ros.core.types import Array

REFERENCE_GAIN = VIBRATION_X.static_gain
"""G(0) in m/V, a convention: F then has the paper's volts (Eq. 5). Only F times G(0) is seen."""
HIGHEST = 800.0
"""Hz up to which the vibration is fitted: past the resonance, short of the modes beyond it."""
CORNER = 400.0
SLOW_INVERSE = InverseDesign(SmoothWeight(corner=CORNER, order=3))
"""What of the hysteresis record is believed, up to CORNER Hz: its ramps are slow, noise is not."""
RAMP_PERIODS = 10.0
"""Periods of CORNER that a ramp across the range must last: within three, loops widen by 2 %."""
SETTLED = 1e-6
"""Largest change of the Everett surface from round to round, over the range of F, to stop at."""
ROUNDS = 10


@frozen(eq=False)
class AxisRecord:
    """One axis of a record: drive (V) and displacement (m), both (n,)."""

    drive: Array
    displacement: Array
    sample_period: float

    @classmethod
    def of(cls, recording: CalibrationRecord, axis: str) -> "AxisRecord":
        """Take axis ``"x"`` or ``"y"`` of a recording."""
        drive, displacement = recording.drive.axis(axis), recording.displacement.axis(axis)
        return cls(drive, displacement, recording.sample_period)

    def freed_of(self, creep: CreepModel) -> "AxisRecord":
        """Return the record as it were without creep (Eq. 10)."""
        inverse = Creep(creep, self.sample_period)
        rigid = inverse.invert(inverse.inverse_at_rest(), self.displacement)[1]
        return AxisRecord(self.drive, rigid, self.sample_period)


@frozen(eq=False)
class Converged:
    """Hysteresis and vibration that agree, and what they were read from.

    ``effective`` is F of the hysteresis record, V, shape (n,); ``change`` that of the Everett
    surface in the last of ``rounds``, over F's range. ``orders`` are those tried, where the
    vibration's was to be chosen.
    """

    everett: EverettFit
    vibration: RationalFit
    response: FrequencyResponse
    effective: Array
    rounds: int
    change: float
    orders: OrderChoice | None = None


@frozen
class Sizes:
    """How fine the models are: levels of the Everett surfaces, poles and zeros of the vibration.

    Without an order it is chosen by waves held out. With ``delay`` the vibration takes the
    record's delay for its own.
    """

    levels: int = field(default=LEVELS, validator=ge(3))
    order: Order | None = PAPER
    delay: bool = False


def alternate(
    hysteresis: AxisRecord, frequency: AxisRecord, curves: ReversalCurves, sizes: Sizes
) -> Converged:
    """Identify both from records freed of creep.

    Raises InputError where the reversal curves are too fast, or an order is to be chosen by too
    few waves, ScanError where both do not settle.
    """
    _refuse_fast(hysteresis, curves)
    if sizes.order is not None:
        return _settle(hysteresis, frequency, curves, sizes, sizes.order)
    converged = _settle(hysteresis, frequency, curves, sizes, PAPER)
    waves = strongest_waves(converged.everett.model.operator(), frequency)
    waves = waves.advanced(converged.vibration.model.delay)
    orders = choose_order(waves, frequency.sample_period, REFERENCE_GAIN, HIGHEST)
    converged = _settle(hysteresis, frequency, curves, sizes, orders.chosen)
    return evolve(converged, orders=orders)


def _settle(
    hysteresis: AxisRecord,
    frequency: AxisRecord,
    curves: ReversalCurves,
    sizes: Sizes,
    order: Order,
) -> Converged:
    rigid = hysteresis.displacement / REFERENCE_GAIN
    forward = fit_forward(hysteresis.drive, rigid, curves, sizes.levels)
    terms, change = None, np.inf
    for rounds in range(1, ROUNDS + 1):
        response = response_to(forward.operator, frequency)
        vibration = _vibration(response, frequency.sample_period, order, late=sizes.delay)
        effective = _freed_of(vibration, hysteresis)
        before, signals = forward, (hysteresis.drive, effective, curves)
        if terms is None:
            terms = terms_that_serve(*signals, before)
        forward = fit_forward(*signals, sizes.levels, before.strength, terms)
        change = _change(before, forward)
        if change <= SETTLED:
            everett = fit_everett(*signals, forward)
            return Converged(everett, vibration, response, effective, rounds, change)
    raise ScanError(
        f"hysteresis and vibration still change each other by {change:.2g} of the range after"
        f" {ROUNDS} rounds: ramp the hysteresis record more slowly"
    )


def _freed_of(vibration: RationalFit, hysteresis: AxisRecord) -> Array:
    """Return F, V, (n,), of the hysteresis record. Raises InputError where it cannot be found."""
    try:
        inverse = Vibration(vibration.model, hysteresis.sample_period, SLOW_INVERSE).inverse
    except InputError as error:
        raise InputError(
            f"frequency record: it shows a resonance at {vibration.resonance:.4g} Hz with a damping"
            f" of {vibration.damping:.2g}, whose inverse is none for the hysteresis record: see"
            " that each is sampled at the rate it says"
        ) from error
    return inverse.invert_whole(hysteresis.displacement)


def _vibration(
    response: FrequencyResponse, sample_period: float, order: Order, *, late: bool
) -> RationalFit:
    """Fit the rational model, of a ``late`` record with the delay that it shows."""
    if not late:
        return fit_rational(response, sample_period, REFERENCE_GAIN, HIGHEST, order)
    delay = max(record_delay(response, sample_period, HIGHEST).delay, 0.0)
    fit = fit_rational(response.advanced(delay), sample_period, REFERENCE_GAIN, HIGHEST, order)
    return evolve(fit, model=evolve(fit.model, delay=delay))


def _refuse_fast(hysteresis: AxisRecord, curves: ReversalCurves) -> None:
    spans = np.concatenate([curves.falling, curves.rising])
    ramp = float(np.diff(spans).max() * hysteresis.sample_period)
    if ramp < RAMP_PERIODS / CORNER:
        raise InputError(
            f"hysteresis record: its longest curve takes {1e3 * ramp:.3g} ms; let a ramp from"
            f" saturation to saturation take {1e3 * RAMP_PERIODS / CORNER:.3g} ms at least,"
            f" for beyond {CORNER:.0f} Hz the record is taken for noise"
        )


def response_to(hysteresis: AnyEffect, frequency: AxisRecord) -> FrequencyResponse:
    """Response to F = H(u), the memory followed from the record's depolarised start."""
    effective = _effective(hysteresis, frequency.drive)
    return frequency_response(
        frequency.drive, effective, frequency.displacement, frequency.sample_period
    )


def strongest_waves(hysteresis: AnyEffect, frequency: AxisRecord) -> RecordSpectra:
    """RecordSpectra of the strongest waves of a record, from F = H(u) to displacement."""
    signals = frequency.drive, _effective(hysteresis, frequency.drive), frequency.displacement
    drives, inputs, outputs = (signal[:, np.newaxis] for signal in signals)
    return record_spectra(drives, inputs, outputs, frequency.sample_period).levels()[0]


def _effective(hysteresis: AnyEffect, drive: Array) -> Array:
    return np.asarray(hysteresis.apply(hysteresis.at_rest(), drive)[1])


def _change(before: FittedSurface, after: FittedSurface) -> float:
    return float(np.abs(after.values - before.values).max() / np.ptp(2.0 * after.values))
