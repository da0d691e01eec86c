"""How many poles and zeros a record supports, by what the model predicts of waves it did not see.

Criterion: each wave in turn is held out, the model fitted to the response of the others, and the
held-out wave's output predicted. A larger order is taken only where it lowers the mean squared
relative error by more than twice the standard error of that gain, wave against wave. Beyond the
paper's order a model counts only if the record tells each of its modes: of one beyond the band the
lines see the compliance and neither frequency nor damping, and no inverse should be made of these.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    DAMPINGS,
    PAPER,
    RESONANT,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.identification.vibration.spectra import RecordSpectra, response_matrix

ORDERS = tuple(Order(poles, poles - 1) for poles in (2, 4, 6, 8))
SIGNIFICANT = 2.0
WAVES = 3
UNDAMPED = 2.0 * DAMPINGS[0]
"""Damping ratio below which a mode has merely run into the search's bound."""
EDGE = 1e-9
"""Relative, for the band's own last line to lie within."""


@frozen
class OrderTrial:
    """One order and the rms relative error of its predictions, wave by held-out wave.

    ``told`` is whether the record shows each of its modes.
    """

    order: Order
    errors: tuple[float, ...]
    told: bool = True

    @property
    def error(self) -> float:
        """Rms over all waves."""
        return float(np.sqrt(np.mean(np.square(self.errors))))

    def beats(self, smaller: "OrderTrial") -> bool:
        """Whether this order predicts significantly better than a smaller one."""
        gain = np.square(smaller.errors) - np.square(self.errors)
        doubt = gain.std(ddof=1) / np.sqrt(len(gain))
        return bool(gain.mean() > SIGNIFICANT * doubt)


@frozen
class OrderChoice:
    """Every order tried, smallest first, and the one that the criterion chooses."""

    trials: tuple[OrderTrial, ...]

    @property
    def chosen(self) -> Order:
        """The smallest order told that none of the larger ones told beats."""
        best = self.trials[0]
        for trial in self.trials[1:]:
            best = trial if trial.told and trial.beats(best) else best
        return best.order


def choose_order(
    spectra: RecordSpectra,
    sample_period: float,
    gauge: float,
    highest: float,
    orders: Sequence[Order] = ORDERS,
) -> OrderChoice:
    """Try each of ``orders`` on the waves of a record from one input to one output.

    ``gauge`` (m/V) and ``highest`` (Hz) are those of ``fit_rational``. Raises InputError for fewer
    than three waves.
    """
    waves = len(spectra.inputs)
    if waves < WAVES:
        raise InputError(
            f"frequency record: {waves} waves; an order is chosen by holding out each in turn, so"
            f" drive at least {WAVES} draws of the phases"
        )
    trials = []
    for order in sorted(orders, key=lambda order: order.parameters):
        errors = []
        for wave in range(waves):
            held_out = np.arange(waves) == wave
            seen = FrequencyResponse.between(response_matrix(spectra.only(~held_out)), 0, 0)
            fit = fit_rational(seen, sample_period, gauge, highest, order)
            errors.append(_error(fit, spectra.only(held_out), sample_period))
        whole = FrequencyResponse.between(response_matrix(spectra), 0, 0)
        told = _told(fit_rational(whole, sample_period, gauge, highest, order))
        trials.append(OrderTrial(order, tuple(errors), told))
    return OrderChoice(tuple(trials))


def _told(fit: RationalFit) -> bool:
    """Whether each mode lies in the band and has a damping; the paper's order is taken as it is."""
    poles = np.roots(fit.model.denominator)
    frequency, damping = np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles)
    mode = damping < RESONANT
    shown = (frequency <= fit.band[1]) & (damping > UNDAMPED)
    return fit.order.poles <= PAPER.poles or bool(np.all(shown[mode]))


def _error(fit: RationalFit, wave: RecordSpectra, sample_period: float) -> float:
    """Rms relative error of the prediction of a wave's output, over the band."""
    band = wave.omega <= 2.0 * np.pi * fit.band[1] * (1.0 + EDGE)
    response = fit.gain_ratio * held(fit.model, sample_period).response(wave.omega[band])
    measured, given = wave.outputs[0, band, 0], wave.inputs[0, band, 0]
    return float(np.sqrt(np.mean(np.abs(1.0 - response * given / measured) ** 2)))
