"""The fit report as a page: what was fitted on what, how well, and what is left."""

from collections.abc import Iterator, Mapping

import numpy as np

from afm_scan_ros.core.identification.creep.order import CRITERION
from afm_scan_ros.core.identification.identify import AxisIdentification, Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.report import html
from afm_scan_ros.report.fit_figures import (
    creep_figure,
    hysteresis_figure,
    model_discrepancy_figure,
)
from afm_scan_ros.report.fit_summary import RECORDS
from afm_scan_ros.report.fit_vibration import between, vibration_section

MERIT = (
    "Sigma is the standard deviation of the error about zero, with N - 1 (the paper's Eqs. 2 and"
    " 18), max its largest magnitude (Eqs. 3 and 19). Intervals are of 95 %. Those of creep"
    " take the record's noise for all that is uncertain."
)
KNOWN = (
    "Measured minus predicted displacement of a record that fitted nothing. The error is free of"
    " the sensor's noise, which is taken for white from the rest before the first move. Where a"
    " later residual stays below both together, it shows nothing that the model does not know."
)

Rows = list[tuple[str, ...]]


def fit_page(found: Identification) -> str:
    """Return the fit report as a self-contained HTML page."""
    return html.page("A scanner's model, and how well it fits", *_parts(found))


def _parts(found: Identification) -> Iterator[str]:
    axes = found.axes
    for name, axis in axes.items():
        yield from (html.warning(f"{name}: {text}") for text in axis.report.warnings)
    yield html.paragraph(MERIT)
    yield html.heading("Creep")
    yield html.paragraph(f"Record {RECORDS['creep']}. The order is {CRITERION}.")
    yield html.table(("", "gain", "time constant, s"), _elements(axes))
    yield html.table(("", "sigma, nm", "max, nm", "samples"), _creep(axes))
    yield html.picture(creep_figure(found), "Creep held out: by order, and the chosen one's error")
    yield from vibration_section(axes)
    yield html.heading("Hysteresis")
    yield html.paragraph(f"Record {RECORDS['hysteresis']}.")
    yield html.table(("", "sigma, mV", "max, mV", "samples"), _hysteresis(axes))
    yield html.picture(hysteresis_figure(found), "Loops, and the drive predicted on fresh ones")
    yield html.heading("Known error")
    yield html.paragraph(KNOWN)
    for name, axis in axes.items():
        yield html.paragraph(f"{name}, of the {axis.validation.model_discrepancy.record}")
        yield html.table(("band, Hz", "error, nm", "noise, nm", "of the motion"), _bands(axis))
    yield html.picture(
        model_discrepancy_figure(found), "Residual of prediction, and its rms by band"
    )


def _elements(axes: Mapping[str, AxisIdentification]) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        fit = axis.report.creep
        pairs = zip(fit.model.gains, fit.model.time_constants, strict=True)
        for number, (gain, tau) in enumerate(pairs, start=1):
            known = (fit.intervals[f"{kind}_{number}"] for kind in ("gain", "time_constant"))
            texts = (between(*each) for each in zip((gain, tau), known, strict=True))
            rows.append((f"{name}, element {number}", *texts))
    return rows


def _creep(axes: Mapping[str, AxisIdentification]) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        fit = axis.report.creep
        rows.append((f"{name}, order {fit.order}, fitted", *_merit(fit.fitted, 1e9)))
        rows.append((f"{name}, order {fit.order}, held out", *_merit(fit.held_out, 1e9)))
        rows.append((f"{name}, noise of the record", f"{1e9 * fit.noise:.2f}", "", ""))
    return rows


def _hysteresis(axes: Mapping[str, AxisIdentification]) -> Rows:
    rows: Rows = []
    for name, axis in axes.items():
        report = axis.report
        rows.append((f"{name}, exact inverse, fresh loops", *_merit(report.exact, 1e3)))
        rows.append((f"{name}, direct inverse, fresh loops", *_merit(report.direct, 1e3)))
        closure = f"{1e3 * report.closure:.1f}"
        rows.append((f"{name}, returns to saturation", "", closure, ""))
    return rows


def _bands(axis: AxisIdentification) -> Rows:
    known = axis.validation.model_discrepancy
    share = np.array(known.rms) / np.maximum(known.displacement, np.finfo(float).tiny)
    edges = zip(known.bands, known.bands[1:], strict=False)
    figures = zip(edges, known.rms, known.noise, share, strict=True)
    return [
        (f"{low:g} to {high:g}", f"{1e9 * rms:.2f}", f"{1e9 * noise:.2f}", f"{part:.2%}")
        for (low, high), rms, noise, part in figures
    ]


def _merit(misfit: Misfit, scale: float) -> tuple[str, str, str]:
    return f"{scale * misfit.sigma:.2f}", f"{scale * misfit.maximum:.2f}", f"{misfit.samples:,}"
