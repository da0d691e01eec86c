"""Hysteresis and vibration of one axis, identified in turns.

The hysteresis record must be freed of the vibration's delay, and the frequency response is that
to F = H(u): each needs the other. The first round takes the vibration for its gain at rest; every
next one starts from the vibration just found, until the Everett surface rests. The ramps being
slow, a round shrinks the change some hundredfold.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge

from afm_scan_ros.core.effects.base import AnyEffect
from afm_scan_ros.core.effects.creep import Creep
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
from afm_scan_ros.core.identification.records.hum import HumLine, without_hum
from afm_scan_ros.core.identification.records.recording import CalibrationRecord
from afm_scan_ros.core.identification.vibration.delay import record_delay
from afm_scan_ros.core.identification.vibration.frequency_response import (
    FrequencyResponse,
    frequency_response,
)
from afm_scan_ros.core.identification.vibration.order_selection import OrderChoice, choose_order
from afm_scan_ros.core.identification.vibration.periodic import record_spectra
from afm_scan_ros.core.identification.vibration.rational_fit import (
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.identification.vibration.slow_inverse import (
    corner,
    shortest_ramp,
    slow_input,
)
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.paper import VIBRATION_X
from afm_scan_ros.core.types import Array

REFERENCE_GAIN = VIBRATION_X.static_gain
"""G(0) in m/V, a convention: F then has the paper's volts (Eq. 5). Only F times G(0) is seen."""
SETTLED = 1e-6
"""Largest change of the Everett surface from round to round, over the range of F, to stop at."""
ROUNDS = 10
EDGE = 1e-9
"""Relative, for the band's own last line to lie within."""


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

    def without_hum(self) -> "tuple[AxisRecord, tuple[HumLine, ...]]":
        """Return the record without the hum in it, and that hum."""
        quiet, found = without_hum(self.drive, self.displacement, self.sample_period)
        return evolve(self, displacement=quiet), found

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

    Without an order the frequency record chooses it. With ``delay`` the vibration takes the
    record's delay for its own.
    """

    levels: int = field(default=LEVELS, validator=ge(3))
    order: Order | None = None
    delay: bool = False


def alternate(
    hysteresis: AxisRecord, frequency: AxisRecord, curves: ReversalCurves, sizes: Sizes
) -> Converged:
    """Identify both from records freed of creep.

    Where they do not settle, the order that was chosen has poles that the records do not tell, and
    those of fewer poles are tried. Raises InputError where the reversal curves are too fast or no
    line of the frequency response stands out of the noise, ScanError where both do not settle.
    """
    rigid = hysteresis.displacement / REFERENCE_GAIN
    forward = fit_forward(hysteresis.drive, rigid, curves, sizes.levels)
    records = hysteresis, frequency, curves
    if sizes.order is not None:
        attempts: list[tuple[Order, OrderChoice | None]] = [(sizes.order, None)]
    else:
        first = response_to(forward.operator, frequency).seen()
        orders = _orders(first, frequency.sample_period, late=sizes.delay)
        attempts = [(each.chosen, each) for each in orders.narrowing()]
    for order, chosen in attempts:
        found = _settled(records, forward, order, chosen, sizes)
        if found.change <= SETTLED:
            return found
    raise ScanError(
        f"hysteresis and vibration still change each other by {found.change:.2g} of the range after"
        f" {ROUNDS} rounds, with {order} of the vibration: give fewer, as --order 2 0, in Python"
        " order=(2, 0), or ramp the hysteresis record more slowly"
    )


def _settled(
    records: tuple[AxisRecord, AxisRecord, ReversalCurves],
    forward: FittedSurface,
    order: Order,
    orders: OrderChoice | None,
    sizes: Sizes,
) -> Converged:
    """Identify both in turns, until neither changes or the rounds are over."""
    hysteresis, frequency, curves = records
    shapes = [] if orders is None else [orders.best.shape]
    first = response_to(forward.operator, frequency).seen()
    highest, terms = float(first.frequency[-1]) * (1.0 + EDGE), None
    rounds, change = 0, np.inf
    while change > SETTLED and rounds < ROUNDS:
        rounds += 1
        response = response_to(forward.operator, frequency).up_to(highest)
        vibration = _vibration(response, frequency.sample_period, order, shapes, late=sizes.delay)
        _refuse_fast(hysteresis, curves, vibration.resonance)
        effective = slow_input(vibration.model, hysteresis.displacement, hysteresis.sample_period)
        before, signals = forward, (hysteresis.drive, effective, curves)
        if terms is None:
            terms = terms_that_serve(*signals, before)
        forward = fit_forward(*signals, sizes.levels, before.strength, terms)
        change = _change(before, forward)
    everett = fit_everett(*signals, forward)
    return Converged(everett, vibration, response, effective, rounds, change, orders)


def _vibration(
    response: FrequencyResponse,
    sample_period: float,
    order: Order,
    shapes: Sequence[Array],
    *,
    late: bool,
) -> RationalFit:
    """Fit the rational model, of a ``late`` record with the delay that it shows."""
    fit = fit_rational(response, sample_period, REFERENCE_GAIN, order, shapes)
    if not late:
        return fit
    delay = max(record_delay(response, sample_period, fit.resonance).delay, 0.0)
    early = response.advanced(delay)
    fit = fit_rational(early, sample_period, REFERENCE_GAIN, order, shapes)
    return evolve(fit, model=evolve(fit.model, delay=delay))


def _orders(response: FrequencyResponse, sample_period: float, *, late: bool) -> OrderChoice:
    """Try orders, of a ``late`` record without its delay: poles and zeros would stand for it."""
    orders = choose_order(response, sample_period, REFERENCE_GAIN)
    if not late:
        return orders
    shapes = [orders.best.shape]
    rough = fit_rational(response, sample_period, REFERENCE_GAIN, orders.chosen, shapes)
    delay = max(record_delay(response, sample_period, rough.resonance).delay, 0.0)
    return choose_order(response.advanced(delay), sample_period, REFERENCE_GAIN)


def _refuse_fast(hysteresis: AxisRecord, curves: ReversalCurves, resonance: float) -> None:
    spans = np.concatenate([curves.falling, curves.rising])
    ramp = float(np.diff(spans).max() * hysteresis.sample_period)
    if ramp < (least := shortest_ramp(resonance)):
        raise InputError(
            f"hysteresis record: its longest curve takes {1e3 * ramp:.3g} ms; let a ramp from"
            f" saturation to saturation take {1e3 * least:.3g} ms at least, for beyond"
            f" {corner(resonance):.0f} Hz, near the resonance, the record is taken for noise"
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
