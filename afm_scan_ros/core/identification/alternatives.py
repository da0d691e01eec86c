"""Other descriptions of the same records, as good as the one chosen → intervals that hold.

The scatter of a frequency record says how far its figures would lie from another record's, not how
far they lie from the scanner's: a mode beyond the band bends a model without it, and loops smaller
than a cell of the Everett surface are taken for the vibration's. Neither shows in the residual, for
the fit bends with them. Both show when the records are described anew: with one mode more, with a
surface twice as fine, with both. The intervals span these descriptions, and beyond them the
scatter's own half-widths.
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.identification.alternating import (
    EDGE,
    REFERENCE_GAIN,
    AxisRecord,
    Converged,
    response_to,
)
from afm_scan_ros.core.identification.covariance import Interval
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import fit_surface
from afm_scan_ros.core.identification.hysteresis.reversal_curves import ReversalCurves
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import (
    LINES_PER_POLE,
    Order,
    RationalFit,
    fit_rational,
)
from afm_scan_ros.core.types import Array

FINEST = 201
"""Levels beyond which no finer surface is tried."""


def alternatives(
    converged: Converged, drive: Array, frequency: AxisRecord, curves: ReversalCurves
) -> Mapping[str, RationalFit]:
    """Fit the vibration under the other descriptions, named by what differs.

    ``drive`` (V, (n,)) is the hysteresis record's, ``frequency`` a record freed of creep.
    """
    order = converged.vibration.order
    more = Order(order.poles + 2, order.zeros + 2)
    responses = {"": converged.response, **_finer(converged, drive, frequency, curves)}
    delay = converged.vibration.model.delay
    found = {}
    for finer, response in responses.items():
        early = response.advanced(delay).up_to(converged.vibration.band[1] * (1.0 + EDGE))
        for each in (order, more):
            words = [str(each)] * (each != order) + [finer] * (finer != "")
            if words and len(early.omega) >= LINES_PER_POLE * each.poles:
                fit = fit_rational(early, frequency.sample_period, REFERENCE_GAIN, each)
                found[", ".join(words)] = fit
    return found


def _finer(
    converged: Converged, drive: Array, frequency: AxisRecord, curves: ReversalCurves
) -> Mapping[str, FrequencyResponse]:
    """Response to F of a surface twice as fine, by its name; none where that is too fine."""
    fitted = converged.everett.forward
    levels = 2 * fitted.grid.size - 1
    if levels > FINEST:
        return {}
    grid = EverettGrid(fitted.grid.lower, fitted.grid.upper, levels)
    found = curves.of(drive, converged.effective)
    finer = fit_surface(found, grid, fitted.strength, terms=fitted.terms).monotone()
    return {f"{levels} levels": response_to(finer.operator, frequency)}


def spanning(fit: RationalFit, others: Iterable[RationalFit]) -> RationalFit:
    """Return the fit with intervals that span what the others find, and the scatter beyond."""
    found = [fit, *others]
    modes = [(fit.resonance, fit.damping), *(_same_mode(each, fit) for each in found[1:])]
    frequencies, dampings = zip(*modes, strict=True)
    return evolve(
        fit,
        resonance_interval=_span(fit.resonance_interval, frequencies),
        damping_interval=_span(fit.damping_interval, dampings),
        gain_interval=_span(fit.gain_interval, [f.gain_ratio for f in found]),
    )


def _same_mode(other: RationalFit, fit: RationalFit) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of the pole that is nearest: another may peak higher."""
    poles = np.roots(other.model.denominator)
    omega = np.abs(poles)
    nearest = int(np.argmin(np.abs(np.log(omega / (2.0 * np.pi * fit.resonance)))))
    return float(omega[nearest] / (2.0 * np.pi)), float(-poles[nearest].real / omega[nearest])


def _span(interval: Interval, values: Sequence[float]) -> Interval:
    """Widen the interval of the first value to the range of all."""
    low, high = interval
    return low + min(values) - values[0], high + max(values) - values[0]
