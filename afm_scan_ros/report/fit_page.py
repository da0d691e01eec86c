"""The fit report as a page: what was fitted on what, and how well."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.identification.fit_report import VibrationChecks
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.joint.axis import JointAxis
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.identification.vibration.rational_fit import RationalFit
from afm_scan_ros.core.identification.vibration.structure import OrderChoice
from afm_scan_ros.core.model import ModelDiscrepancy
from afm_scan_ros.report import html
from afm_scan_ros.report.effect_status_text import intervals_text, status_text
from afm_scan_ros.report.fit_figures import (
    bode_figure,
    creep_figure,
    hysteresis_figure,
    model_discrepancy_figure,
)
from afm_scan_ros.report.fit_summary import (
    CREEP_ORDER,
    RECORDS,
    VIBRATION_ORDER,
    finding_text,
    inverse_text,
    operator_text,
)

MERIT = (
    "Sigma is the standard deviation of the error about zero, with N - 1 (the paper's Eqs. 2 and"
    " 18). Max is its largest magnitude (Eqs. 3 and 19). Intervals are 95 % intervals. Those of"
    " creep account for the record's noise alone."
)
KNOWN = (
    "Model discrepancy is measured minus predicted displacement of a held-out record, without"
    " sensor noise. The noise is estimated at rest before the first move, and is taken as white."
    " Both together are the detection limit of a later diagnosis."
)

JOINT = (
    "The records do not hold one of each kind, so all were fitted together. 'Held out' is the error"
    " of each part of the records under a fit of parts of other amplitudes, on a coarse grid."
)
SPAN = (
    "The intervals of resonance, damping and gain contain the values of the other models listed:"
    " one mode more, and an Everett surface twice as fine. They are widened by the scatter from"
    " noise and nonlinearity. They do not contain errors that no such model describes: minor loops"
    " that are not congruent, coupling of the axes, or a nonlinear sensor."
)
AT_ZERO = (
    "'At zero amplitude' is the response to the drive u, extrapolated from waves of decreasing"
    " amplitude without a hysteresis model. No interval is given, because the error of the linear"
    " extrapolation is unknown."
)
DELAY = (
    "The delay is the lag of the record beyond poles without zeros and one mode above the band. Its"
    " interval spans two bands. It does not contain the lag of the scanner's own zeros, some µs at"
    " most."
)
Axes = Mapping[str, AxisIdentification]
Rows = list[tuple[str, ...]]


def fit_page(found: Identification) -> str:
    """Return the fit report as a self-contained HTML page."""
    return html.page("Identification of a scanner", *_parts(found))


def _parts(found: Identification) -> Iterator[str]:
    axes = found.axes
    every: dict[str, AxisIdentification | JointAxis] = {**found.axes, **found.joint}
    for name, axis in every.items():
        yield from (html.warning(f"{name}: {finding_text(each)}") for each in axis.warnings)
    yield html.heading("What is known")
    yield html.table(("", "known, and where it holds", "95 % intervals"), _known(found))
    yield from (part for each in found.joint.items() for part in _joint_parts(*each))
    if axes:
        yield from _axes_parts(found)


def _known(found: Identification) -> Rows:
    return [
        (f"{axis}, {effect}", status_text(status), intervals_text(status))
        for axis in found.model.axes
        for effect, status in found.model.axis(axis).effects.each()
    ]


def _joint_parts(name: str, axis: JointAxis) -> Iterator[str]:
    yield html.heading(f"Axis {name}: all records fitted together")
    yield html.paragraph(JOINT)
    rows: Rows = [(each.name, each.kind or "motion") for each in axis.records]
    yield html.table(("record", "recognised as"), rows)
    if axis.joint is not None:
        fit = axis.joint
        merit = [("fitted", f"{1e9 * fit.fitted:.1f}"), ("held out", f"{1e9 * fit.held_out:.1f}")]
        yield html.table(("", "displacement error, nm rms"), merit)


def _axes_parts(found: Identification) -> Iterator[str]:
    axes = found.axes
    yield html.paragraph(MERIT)
    yield html.heading("Creep")
    yield html.paragraph(f"Record: {RECORDS['creep']}. {CREEP_ORDER}")
    yield html.table(("", "gain", "time constant, s"), _elements(axes))
    yield html.table(("", "sigma, nm", "max, nm", "samples"), _creep(axes))
    yield html.picture(
        creep_figure(found), "Held-out creep error by order, and the residual of the chosen order"
    )
    yield from vibration_section(axes)
    yield html.heading("Hysteresis")
    yield html.paragraph(f"Record: {RECORDS['hysteresis']}.")
    for name, axis in axes.items():
        if (choice := axis.report.operator) is not None:
            yield html.paragraph(f"{name}: {operator_text(choice)}.")
    yield html.table(("", "sigma, mV", "max, mV", "samples"), _hysteresis(axes))
    yield html.picture(
        hysteresis_figure(found), "Loops, and the errors of both inverses on held-out loops"
    )
    yield html.heading("Model discrepancy")
    yield html.paragraph(KNOWN)
    for name, axis in axes.items():
        if axis.validation is None:
            continue
        known = axis.validation.model_discrepancy
        yield html.paragraph(f"{name}: {known.record}")
        yield html.table(
            ("band, Hz", "discrepancy, nm rms", "noise, nm rms", "discrepancy / motion"),
            _bands(known),
        )
    yield html.picture(
        model_discrepancy_figure(found), "Prediction residual, and model discrepancy by band"
    )


def _elements(axes: Axes) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        fit = axis.report.creep
        pairs = zip(fit.model.gains, fit.model.time_constants, strict=True)
        for number, (gain, tau) in enumerate(pairs, start=1):
            known = (fit.intervals[f"{kind}_{number}"] for kind in ("gain", "time_constant"))
            texts = (between(*each) for each in zip((gain, tau), known, strict=True))
            rows.append((f"{name}, element {number}", *texts))
    return rows


def _creep(axes: Axes) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        fit = axis.report.creep
        rows.append((f"{name}, order {fit.order}, fitted", *_merit(fit.fitted, 1e9)))
        rows.append((f"{name}, order {fit.order}, held out", *_merit(fit.held_out, 1e9)))
        rows.append((f"{name}, noise of the record", f"{1e9 * fit.noise:.2f}", "", ""))
    return rows


def _hysteresis(axes: Axes) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        report = axis.report
        for which, error in (("exact", report.exact), ("direct", report.direct)):
            if error is not None:
                inverse = inverse_text(which, axis.model.hysteresis)
                rows.append((f"{name}, held-out loops, {inverse}", *_merit(error, 1e3)))
        closure = f"{1e3 * report.closure:.1f}"
        rows.append((f"{name}, difference among returns to saturation", "", closure, ""))
    return rows


def _bands(known: ModelDiscrepancy) -> Rows:
    share = np.array(known.rms) / np.maximum(known.displacement, np.finfo(float).tiny)
    edges = zip(known.bands, known.bands[1:], strict=False)
    figures = zip(edges, known.rms, known.noise, share, strict=True)
    return [
        (f"{low:g} to {high:g}", f"{1e9 * rms:.2f}", f"{1e9 * noise:.2f}", f"{part:.2%}")
        for (low, high), rms, noise, part in figures
    ]


def _merit(misfit: Misfit, scale: float) -> tuple[str, str, str]:
    return f"{scale * misfit.sigma:.2f}", f"{scale * misfit.maximum:.2f}", f"{misfit.samples:,}"


def vibration_section(axes: Axes) -> Iterator[str]:
    """HTML of the section, part by part."""
    yield html.heading("Vibration")
    yield html.paragraph(f"Record: {RECORDS['vibration']}.")
    yield html.table(("", *axes), _figures(axes))
    yield html.paragraph(SPAN)
    yield html.table(
        ("model", "resonance, Hz", "damping ratio", "gain / reference gain"), _spanned(axes)
    )
    yield html.paragraph(f"{AT_ZERO} {DELAY}")
    for name, axis in axes.items():
        orders = axis.report.checks.orders
        if orders is not None:
            yield html.paragraph(f"{name}: {VIBRATION_ORDER}")
            yield html.table(("order", "model minus response, relative rms"), _orders(orders))
        fit = axis.report.vibration
        bode = bode_figure(axis.response, fit, axis.sample_period, axis.at_zero_amplitude)
        yield html.picture(bode, f"{name}: response from F to displacement")


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
        ("resonance at zero amplitude, Hz", *(_at_zero(c, "resonance", 7) for c in checks)),
        ("damping ratio", *(between(f.damping, f.damping_interval, 5) for f in fits)),
        ("damping ratio at zero amplitude", *(_at_zero(c, "damping", 5) for c in checks)),
        ("gain / reference gain", *(between(f.gain_ratio, f.gain_interval, 5) for f in fits)),
        ("delay of the record, µs", *map(_delay, checks, fits)),
        ("delay in the model, µs", *(f"{1e6 * f.model.delay:.2f}" for f in fits)),
        ("model minus response, relative rms", *(f"{f.misfit:.2%}" for f in fits)),
        ("noise, relative rms", *(f"{f.noise_share:.2%}" for f in fits)),
        ("nonlinearity, relative rms", *(f"{f.nonlinearity_share:.2%}" for f in fits)),
    ]


def _at_zero(checks: VibrationChecks, figure: str, digits: int) -> str:
    if checks.at_zero is None:
        return "one amplitude only"
    return f"{getattr(checks.at_zero, figure):.{digits}g}"


def _delay(checks: VibrationChecks, fit: RationalFit) -> str:
    if not checks.identifies_delay(fit):
        return "not determined"
    low, high = checks.delay.interval
    return f"{1e6 * checks.delay.delay:.2f} ({1e6 * low:.2f} to {1e6 * high:.2f})"


def _spanned(axes: Axes) -> Rows:
    fits = {
        f"{name}, {which}": fit
        for name, axis in axes.items()
        for which, fit in {
            "as stated": axis.report.vibration,
            **axis.report.checks.alternatives,
        }.items()
    }
    return [
        (name, f"{fit.resonance:.7g}", f"{fit.damping:.5g}", f"{fit.gain_ratio:.5g}")
        for name, fit in fits.items()
    ]


def _orders(choice: OrderChoice) -> Rows:
    outside = ", with a mode outside the band"
    verdicts = {trial.order: "" if trial.determined else outside for trial in choice.trials}
    verdicts[choice.chosen] = ", chosen"
    return [(f"{t.order}{verdicts[t.order]}", f"{t.misfit:.4%}") for t in choice.trials]
