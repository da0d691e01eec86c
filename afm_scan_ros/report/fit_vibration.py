"""The fit report's part on the vibration: figures, what their intervals span, orders, delay."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.identification.identify import AxisIdentification
from afm_scan_ros.core.identification.vibration.checks import VibrationChecks
from afm_scan_ros.core.identification.vibration.order_selection import (
    CRITERION,
    OrderChoice,
    OrderTrial,
)
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.report import html
from afm_scan_ros.report.bode import bode_figure
from afm_scan_ros.report.fit_summary import RECORDS

SPAN = (
    "The intervals of resonance, damping and gain span what the records say under the other"
    " descriptions listed, with one mode more and with an Everett surface twice as fine, and reach"
    " beyond by what noise and nonlinearity scatter. They do not hold what no such description"
    " tells: minor loops that are not congruent, coupling of the axes, a sensor that is not linear."
)
AT_ZERO = (
    "At zero amplitude stands the response to the drive u, extrapolated from weaker and weaker"
    " waves without a model of the hysteresis. No interval is given there: it would not hold how"
    " far the straight line is from the law."
)
DELAY = (
    "The delay is what the record lags beyond poles without zeros and one mode beyond the band. Its"
    " interval spans two bands; what a scanner's own zeros lag, some µs at most, is not in it."
)
Axes = Mapping[str, AxisIdentification]
Rows = list[tuple[str, ...]]


def vibration_section(axes: Axes) -> Iterator[str]:
    """HTML of the section, part by part."""
    yield html.heading("Vibration")
    yield html.paragraph(f"Record {RECORDS['vibration']}.")
    yield html.table(("", *axes), _figures(axes))
    yield html.paragraph(SPAN)
    yield html.table(("", "resonance, Hz", "damping ratio", "gain over the gauge"), _spanned(axes))
    yield html.paragraph(f"{AT_ZERO} {DELAY}")
    for name, axis in axes.items():
        orders = axis.report.checks.orders
        if orders is not None:
            yield html.paragraph(f"{name}: the order is {CRITERION}.")
            yield html.table(("", "error on held-out waves, rms"), _orders(orders))
        fit = axis.report.vibration
        bode = bode_figure(axis.response, fit, axis.sample_period, axis.at_zero_amplitude)
        yield html.picture(bode, f"{name}: response from F to displacement; grey is not fitted")


def between(value: float, interval: tuple[float, float], digits: int = 4) -> str:
    """Value and interval, an open end as a question mark."""
    low, high = (f"{end:.{digits}g}" if np.isfinite(end) else "?" for end in interval)
    return f"{value:.{digits}g} ({low} to {high})"


def _figures(axes: Axes) -> Rows:
    fits = [axis.report.vibration for axis in axes.values()]
    checks = [axis.report.checks for axis in axes.values()]
    return [
        ("order", *(str(f.order) for f in fits)),
        ("band, Hz", *(f"{f.band[0]:.0f} to {f.band[1]:.0f}" for f in fits)),
        ("resonance, Hz", *(between(f.resonance, f.resonance_interval, 7) for f in fits)),
        ("at zero amplitude, Hz", *(_at_zero(c, "resonance", 7) for c in checks)),
        ("its damping ratio", *(between(f.damping, f.damping_interval, 5) for f in fits)),
        ("at zero amplitude", *(_at_zero(c, "damping", 5) for c in checks)),
        ("gain over the gauge", *(between(f.gain_ratio, f.gain_interval, 5) for f in fits)),
        ("delay of the record, µs", *map(_delay, checks, fits)),
        ("delay in the model, µs", *(f"{1e6 * f.model.delay:.2f}" for f in fits)),
        ("model from response, rms", *(f"{f.misfit:.2%}" for f in fits)),
        ("noise's share", *(f"{f.noise_share:.2%}" for f in fits)),
        ("nonlinearity's share", *(f"{f.nonlinearity_share:.2%}" for f in fits)),
    ]


def _at_zero(checks: VibrationChecks, figure: str, digits: int) -> str:
    if checks.at_zero is None:
        return "one amplitude only"
    return f"{getattr(checks.at_zero, figure):.{digits}g}"


def _delay(checks: VibrationChecks, fit: RationalFit) -> str:
    if not checks.tells_delay(fit):
        return "this record cannot tell"
    low, high = checks.delay.interval
    return f"{1e6 * checks.delay.delay:.2f} ({1e6 * low:.2f} to {1e6 * high:.2f})"


def _spanned(axes: Axes) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        fit, others = axis.report.vibration, axis.report.checks.alternatives
        for words, each in {"as stated": fit, **others}.items():
            figures = f"{each.resonance:.7g}", f"{each.damping:.5g}", f"{each.gain_ratio:.5g}"
            rows.append((f"{name}, {words}", *figures))
    return rows


def _orders(choice: OrderChoice) -> Rows:
    return [
        (f"{trial.order}{_verdict(trial, choice)}", f"{trial.error:.4%}") for trial in choice.trials
    ]


def _verdict(trial: OrderTrial, choice: OrderChoice) -> str:
    if trial.order == choice.chosen:
        return ", chosen"
    return "" if trial.told else ", with a mode that the band does not show"
