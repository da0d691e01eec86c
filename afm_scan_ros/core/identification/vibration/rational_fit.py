"""Frequency response of a sampled system → the rational vibration model behind its hold.

The converter holds each input sample; the output is sampled just before the next update. What is
fitted is therefore the zero-order-hold response of G(s), not G(jω). The fit maximises the
likelihood of the scatter, widened by what so short a model must be expected to miss.
"""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.covariance import (
    Interval,
    intervals_95,
    sandwich,
    slopes,
)
from afm_scan_ros.core.identification.findings import Finding
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_form import (
    PAPER,
    Order,
    polynomials,
)
from afm_scan_ros.core.identification.vibration.rational_search import Band, search
from afm_scan_ros.core.identification.vibration.response_checks import response_findings
from afm_scan_ros.core.model import VibrationModel
from afm_scan_ros.core.types import Array

LINES_PER_POLE = 5


@frozen
class RationalFit:
    """The model with its gain at rest set to the gauge, and how well it fits the band.

    ``gain_ratio`` is the gain that the record shows over the gauge: 1 where the input F and the
    gauge agree. ``misfit`` is the rms of the relative error over the lines used. An interval
    holds 95 % of what the scatter from wave to wave would give; it assumes that the model's order
    is the scanner's.
    """

    model: VibrationModel
    gain_ratio: float
    misfit: float
    band: Interval
    """Lowest and highest line used, Hz."""
    resonance: float
    """Frequency of the pole with the highest peak, Hz."""
    damping: float
    """Its damping ratio."""
    resonance_interval: Interval
    """Hz."""
    damping_interval: Interval
    gain_interval: Interval
    """Of ``gain_ratio``."""
    noise_share: float
    """Noise of the response over the response, rms over the band."""
    nonlinearity_share: float
    """The same of what differs from wave to wave beyond the noise."""
    warnings: tuple[Finding, ...]
    """What the record does not determine."""

    @property
    def order(self) -> Order:
        """Poles and zeros of the model."""
        return Order(len(self.model.denominator) - 1, len(self.model.numerator) - 1)


def fit_rational(
    measured: FrequencyResponse,
    sample_period: float,
    gauge: float,
    highest: float,
    order: Order = PAPER,
) -> RationalFit:
    """Fit a model of ``order``, all poles stable, to the lines up to ``highest`` Hz.

    The error is weighed by its expected size: the measured scatter, and ``EXPECTED`` of the
    response itself, so that resonance, slope and zeros count alike. ``gauge`` is the
    gain at rest, m/V, that the model is given. Raises InputError where the band holds too few
    lines.
    """
    used = measured.up_to(highest)
    lines, needed = len(used.omega), LINES_PER_POLE * order.poles
    if lines < needed:
        raise InputError(
            f"frequency record: {lines} excited lines up to {highest:g} Hz, {needed} needed for"
            f" {order}; drive more of them"
        )
    band = Band.of(used, sample_period, gauge, order)
    parameters = search(band)
    scatter = band.spread(band.error(parameters), order.parameters)
    spread = sandwich(slopes(band.residual, parameters), scatter)
    return _result(parameters, spread, band, used)


def _result(parameters: Array, spread: Array, band: Band, used: FrequencyResponse) -> RationalFit:
    frequency, damping, ratio = (float(value) for value in band.figures(parameters))
    intervals = intervals_95(band.figures, parameters, spread)
    relative = np.abs(band.error(parameters) / band.response)
    low, high = (float(edge / (2.0 * np.pi)) for edge in used.omega[[0, -1]])
    return RationalFit(
        model=_model(parameters, band),
        gain_ratio=ratio,
        misfit=float(np.sqrt(np.mean(relative**2))),
        band=(low, high),
        resonance=frequency,
        damping=damping,
        resonance_interval=intervals[0],
        damping_interval=intervals[1],
        gain_interval=intervals[2],
        noise_share=used.noise_share,
        nonlinearity_share=used.nonlinearity_share,
        warnings=response_findings(used, frequency, damping),
    )


def _model(parameters: Array, band: Band) -> VibrationModel:
    """Return the polynomials in s of rad/s, the gain at rest set to the gauge."""
    numerator, denominator = polynomials(parameters, band.order)
    scale = band.unit ** np.arange(band.order.poles + 1)
    numerator = band.gauge / parameters[-1] * numerator * scale[-len(numerator) :]
    return VibrationModel(
        numerator=tuple(float(b) for b in numerator),
        denominator=tuple(float(a) for a in denominator * scale),
    )
