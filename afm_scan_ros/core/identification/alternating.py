"""Hysteresis and vibration of one axis, identified in turns.

The hysteresis record must be freed of the vibration's delay, and the frequency response is that
to F = H(u): each needs the other. The first round takes the vibration for its gain at rest; every
next one starts from the vibration just found, until the hysteresis rests. The ramps being
slow, a round shrinks the change some hundredfold.

F follows from the displacement by the optimal inverse of Croft, Shed and Devasia (2001), Eq. 22,
with R/Q = (f / f_c)⁶, over the whole record at once in the frequency domain. The corner f_c lies
just below the resonance: ramps are slow, and what is faster is noise. No impulse response is cut
off, so the inverse exists whatever the model's poles and zeros are.
"""

from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from afm_scan_ros.core.effects.base import AnyEffect
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.optimal_inverse import SmoothWeight
from afm_scan_ros.core.effects.vibration import VIBRATION_X
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.hysteresis.duhem_fit import FittedSlopes, refit
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
from afm_scan_ros.core.identification.vibration.frequency_response import frequency_response
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    Order,
    RationalFit,
    fit_rational,
    held_response,
    resonance,
)
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra, record_spectra
from afm_scan_ros.core.identification.vibration.structure import (
    OrderChoice,
    choose_order,
    record_delay,
)
from afm_scan_ros.core.model import EXACT, CreepModel, HysteresisModel, VibrationModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array

CORNER = 0.88
"""Of f_c, over the resonance."""
STEEPNESS = 3
"""Half of the power with which R/Q grows."""
PASSED = 10.0
"""Times the corner up to which anything passes: beyond, R/Q is above 10⁶."""
RETURN = 30.0
"""Periods of the corner in which the padded record returns to where it began."""
RAMP = 10.0
"""Periods of the corner that a ramp across the range must last: within three, loops widen by 2 %"""


def corner(peak: float) -> float:
    """Frequency f_c (Hz) for a highest peak (Hz)."""
    return CORNER * peak


def shortest_ramp(peak: float) -> float:
    """Seconds that a ramp across the range must last at a highest peak (Hz)."""
    return RAMP / corner(peak)


def slow_input(model: VibrationModel, displacement: Array, sample_period: float) -> Array:
    """Return F (V), (n,), of a displacement (m), (n,), below the model's highest peak."""
    count, limit = len(displacement), corner(_highest_peak(model))
    back = int(np.ceil(RETURN / (limit * sample_period)))
    size = next_fast_len(count + back, real=True)
    turn = 0.5 + 0.5 * np.cos(np.linspace(0.0, np.pi, size - count + 2)[1:-1])
    first, last = displacement[0], displacement[-1]
    spectrum = rfft(np.concatenate([displacement, first + (last - first) * turn]))
    frequency = rfftfreq(size, sample_period)
    passed = int(np.searchsorted(frequency, PASSED * limit))
    omega = 2.0 * np.pi * frequency[1:passed]
    gain = _response(model, omega, sample_period)
    weight = SmoothWeight(limit, STEEPNESS).ratio(omega, sample_period) * model.static_gain**2
    spectrum[0] /= model.static_gain
    spectrum[1:passed] *= gain.conj() / (np.abs(gain) ** 2 + weight)
    spectrum[passed:] = 0.0
    return np.asarray(irfft(spectrum, size)[:count])


def _highest_peak(model: VibrationModel) -> float:
    """Frequency (Hz) of the pole with the highest peak."""
    unit = float(np.abs(np.roots(model.denominator)).max())
    numerator, denominator = _scaled(model, unit)
    return resonance(numerator, denominator)[0] * unit / (2.0 * np.pi)


def _scaled(model: VibrationModel, unit: float) -> tuple[Array, Array]:
    """Polynomials in s over a unit (rad/s)."""
    powers = unit ** np.arange(len(model.denominator) - 1, -1.0, -1.0)
    numerator = np.array(model.numerator) * powers[-len(model.numerator) :]
    return numerator / powers[0], np.array(model.denominator) * powers / powers[0]


def _response(model: VibrationModel, omega: Array, sample_period: float) -> Array:
    """Held response at angular frequencies (rad/s), in units of time near the poles' own."""
    order = len(model.denominator) - 1
    unit = abs(model.denominator[-1] / model.denominator[0]) ** (1.0 / order)
    held = held_response(*_scaled(model, unit), omega / unit, sample_period * unit)
    return np.asarray(held * np.exp(-1j * omega * model.delay))


REFERENCE_GAIN = VIBRATION_X.static_gain
"""G(0) in m/V, a convention: F then has the paper's volts (Eq. 5). Only F times G(0) is seen."""
SETTLED = 1e-6
"""Largest change of the hysteresis from round to round, over the range of F, to stop at."""
ROUNDS = 10
F = TypeVar("F", FittedSurface, FittedSlopes)


@frozen(eq=False)
class AxisRecord:
    """One axis of a record: drive (V) and displacement (m), both (n,)."""

    drive: Array
    displacement: Array
    sample_period: float

    @classmethod
    def of(cls, record: Record, axis: str) -> "AxisRecord":
        """Take axis ``"x"`` or ``"y"`` of a record."""
        return cls(*record.signals(axis), record.sample_period)

    def without_hum(self) -> "tuple[AxisRecord, tuple[HumLine, ...]]":
        """Return the record without the hum in it, and that hum."""
        quiet, found = without_hum(self.drive, self.displacement, self.sample_period)
        return evolve(self, displacement=quiet), found

    def freed_of(self, creep: CreepModel) -> "AxisRecord":
        """Return the record as it were without creep (Eq. 10)."""
        inverse = Creep(creep, self.sample_period)
        rigid = inverse.invert(inverse.inverse_at_rest(), self.displacement)[1]
        return AxisRecord(self.drive, rigid, self.sample_period)


@frozen
class Sizes:
    """How fine the models are: levels of the Everett surfaces, poles and zeros of the vibration.

    Without an order the frequency record chooses it. With ``delay`` the vibration takes the
    record's delay for its own.
    """

    levels: int = field(default=LEVELS, validator=ge(3))
    order: Order | None = None
    delay: bool = False


@frozen(eq=False)
class Turn:
    """What a turn identified, and what from; ``effective`` is F of the hysteresis record.

    F is in V, shape (n,); ``change`` is that of the hysteresis in the last of ``rounds``, over F's
    range.
    """

    turns: "Turns"
    vibration: RationalFit
    response: FrequencyResponse
    effective: Array
    rounds: int
    change: float


@frozen(eq=False)
class Turns:
    """The turns, from records freed of creep; lines up to ``highest`` Hz show the vibration.

    ``orders`` are those tried, where the vibration's was to be chosen.
    """

    hysteresis: AxisRecord
    frequency: AxisRecord
    curves: ReversalCurves
    sizes: Sizes
    order: Order
    highest: float
    orders: OrderChoice | None

    @classmethod
    def behind(
        cls,
        operator: AnyEffect,
        hysteresis: AxisRecord,
        frequency: AxisRecord,
        curves: ReversalCurves,
        sizes: Sizes,
    ) -> "Turns":
        """Choose the lines and the order by the response behind an operator of the hysteresis."""
        first = response_to(operator, frequency).seen()
        order, highest = sizes.order, float(first.frequency[-1])
        orders = None
        if order is None:
            orders = _orders(first, frequency.sample_period, late=sizes.delay)
            order = orders.chosen
        return cls(hysteresis, frequency, curves, sizes, order, highest, orders)

    def _vibration(self, response: FrequencyResponse) -> RationalFit:
        """Fit the rational model, of a late record with the delay that it shows."""
        period = self.frequency.sample_period
        shapes = [] if self.orders is None else [self.orders.best.shape]
        fit = fit_rational(response, period, REFERENCE_GAIN, self.order, shapes)
        if not self.sizes.delay:
            return fit
        delay = max(record_delay(response, period, fit.resonance).delay, 0.0)
        early = response.advanced(delay)
        fit = fit_rational(early, period, REFERENCE_GAIN, self.order, shapes)
        return evolve(fit, model=evolve(fit.model, delay=delay))

    def settled(self, fitted: F, refit: Callable[[F, Array], F]) -> tuple[F, Turn]:
        """Take turns until the hysteresis rests, which ``refit`` fits to F anew.

        Where it does not, the order that was chosen has poles that the records do not show, and
        orders of fewer poles are tried. Raises InputError where the reversal curves are too fast,
        ScanError where both do not settle with any order.
        """
        for attempt in self._narrowing():
            found, turn = attempt.taken(fitted, refit)
            if turn.change <= SETTLED or turn.change <= found.scatter:
                return found, turn
        raise ScanError(
            f"hysteresis and vibration still change each other by {turn.change:.2g} of the range"
            f" after {ROUNDS} rounds, with {turn.turns.order} of the vibration: give fewer, as"
            " --order 2 0, in Python order=(2, 0), or ramp the hysteresis record more slowly"
        )

    def _narrowing(self) -> "Iterator[Turns]":
        """Yield these turns, and the same of fewer poles where the order was to be chosen."""
        if self.orders is None:
            yield self
            return
        for each in self.orders.narrowing():
            yield evolve(self, order=each.chosen, orders=each)

    def taken(self, fitted: F, refit: Callable[[F, Array], F]) -> tuple[F, Turn]:
        """Take turns until the hysteresis rests or the rounds are over."""
        slow, change, rounds = self.hysteresis, np.inf, 0
        while change > SETTLED and rounds < ROUNDS:
            rounds += 1
            response = response_to(fitted.operator, self.frequency).up_to(self.highest)
            vibration = self._vibration(response)
            _refuse_fast(slow, self.curves, vibration.resonance)
            effective = slow_input(vibration.model, slow.displacement, slow.sample_period)
            before, fitted = fitted, refit(fitted, effective)
            change = fitted.change_from(before)
        return fitted, Turn(self, vibration, response, effective, rounds, change)


@frozen(eq=False)
class Converged:
    """Hysteresis and vibration that agree in the last ``turn``.

    ``slopes`` are a Duhem operator's, where that describes the scanner better than the surface.
    """

    everett: EverettFit
    turn: Turn
    slopes: FittedSlopes | None = None

    @property
    def turns(self) -> Turns:
        """The turns, with the order with which both settled."""
        return self.turn.turns

    @property
    def hysteresis(self) -> HysteresisModel:
        """The model of the hysteresis."""
        model = self.everett.model
        if self.slopes is None:
            return model
        return evolve(model, forward=self.slopes.slopes, output=None, inverse=EXACT)


def alternate(
    hysteresis: AxisRecord, frequency: AxisRecord, curves: ReversalCurves, sizes: Sizes
) -> Converged:
    """Identify both from records freed of creep.

    Raises InputError where the reversal curves are too fast or no line of the frequency response
    stands out of the noise, ScanError where both do not settle.
    """
    rigid = hysteresis.displacement / REFERENCE_GAIN
    forward = fit_forward(hysteresis.drive, rigid, curves, sizes.levels)
    turns = Turns.behind(forward.operator, hysteresis, frequency, curves, sizes)
    terms: int | None = None

    def refit_surface(before: FittedSurface, effective: Array) -> FittedSurface:
        nonlocal terms
        signals = hysteresis.drive, effective, curves
        if terms is None:
            terms = terms_that_serve(*signals, before)
        return fit_forward(*signals, sizes.levels, before.strength, terms)

    forward, turn = turns.settled(forward, refit_surface)
    everett = fit_everett(hysteresis.drive, turn.effective, curves, forward)
    return Converged(everett, turn)


def with_duhem(converged: Converged, slopes: FittedSlopes) -> Converged:
    """Go on with a Duhem operator in the place of the Everett surface, and an order of its own.

    Raises ScanError where it and the vibration do not settle.
    """
    same = converged.turns
    drive, end = same.hysteresis.drive, same.curves.end

    def refit_slopes(before: FittedSlopes, effective: Array) -> FittedSlopes:
        return refit(before, drive[:end], effective[:end])

    turns = Turns.behind(slopes.operator, same.hysteresis, same.frequency, same.curves, same.sizes)
    slopes, turn = turns.settled(slopes, refit_slopes)
    return evolve(converged, slopes=slopes, turn=turn)


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
