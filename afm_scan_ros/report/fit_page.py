"""The fit report as a page: what was fitted on what, and how well."""

from collections.abc import Iterator
from pathlib import Path

from afm_scan_ros.core.identification.fitted_axis import FittedAxis
from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import ModelDiscrepancy
from afm_scan_ros.report.effect_status_text import intervals_text, status_text
from afm_scan_ros.report.fit_pictures import fit_picture
from afm_scan_ros.report.fit_summary import finding_text
from afm_scan_ros.report.page import CommandLine, Part, ReportPage, Section
from afm_scan_ros.report.picture import MILLI, NANO
from afm_scan_ros.report.table import Rows

KNOWN = ("", "known, and where it holds", "95 % intervals")
LEFT = ("measured less model", "sigma, nm", "max, nm", "samples")
DIRECT = ("drive of the inverse less that of the records", "sigma, mV", "max, mV", "samples")
DISCREPANCY = ("band, Hz", "discrepancy, nm rms", "noise, nm rms", "discrepancy / motion")
MERITS = (
    "Sigma is the standard deviation of the error about zero, with N - 1 (the paper's Eqs. 2 and"
    " 18). Max is its largest magnitude (Eqs. 3 and 19)."
)
METHOD = (
    "Model discrepancy is measured minus predicted displacement of a held-out record, without"
    " sensor noise. The noise is estimated at rest before the first move, and is taken as white."
    " Both together are the detection limit of a later diagnosis."
)


def fit_report(found: Identification, model: Path) -> ReportPage:
    """Return the fit report; ``model`` is the file of the model."""
    warned = [(name, one) for name, axis in found.axes.items() for one in axis.warnings]
    known = [
        (f"{axis}, {effect}", status_text(status), intervals_text(status))
        for axis in found.model.axes
        for effect, status in found.model.axis(axis).effects.each()
    ]
    return ReportPage(
        title="Identification of a scanner",
        answer=list(_answer(found)),
        picture=fit_picture(found, "fit"),
        next_steps=list(_next(model)),
        warnings=[f"{name}: {finding_text(one)}" for name, one in warned],
        evidence=[
            Section("What is known of each effect", [Rows(KNOWN, known)]),
            Section("Fit and prediction of each record", list(_fits(found))),
            Section("Response and vibration", [fit_picture(found, "response")]),
            Section("Creep and hysteresis", [fit_picture(found, "slow")]),
            Section("Model discrepancy", [METHOD, *_discrepancies(found)]),
        ],
    )


def _answer(found: Identification) -> Iterator[str]:
    shares = [f"{100 * a.deviation:.2g} % in {name}" for name, a in found.axes.items()]
    yield (
        "The model predicts the displacement of a scan over the whole drive to"
        f" {' and '.join(shares)} of its range (one standard deviation)."
    )
    left = [
        f"{NANO * one.misfit.sigma:.3g} nm in {name}"
        for name, axis in found.axes.items()
        for one in axis.validations[:1]
    ]
    if left:
        yield f"Of a record that was not fitted it leaves {' and '.join(left)} rms."
    else:
        yield "No record was held out of the fit, so its error in another record is not known."


def _next(model: Path) -> Iterator[CommandLine]:
    bag, diagnosis = (model.with_name(f"{model.stem}_{name}") for name in ("scan", "diagnosis"))
    yield CommandLine(
        "Scan with the model's inverse. Name your scanner with --scanner, or else the simulated one"
        " is scanned.",
        ["scan", "--model", model, "--bag", bag],
    )
    yield CommandLine(
        "Ask now and then whether the scanner still is what the model says.",
        ["diagnose", bag, "--model", model, "--out", diagnosis],
    )


def _fits(found: Identification) -> Iterator[Part]:
    yield MERITS
    for name, axis in found.axes.items():
        yield f"The hysteresis of {name} is of {axis.operator}."
        yield Rows(LEFT, list(_merits(axis)), f"Axis {name}")
        direct = _merit("direct inverse of the hysteresis", axis.direct, MILLI)
        yield Rows(DIRECT, [direct])


def _merits(axis: FittedAxis) -> Iterator[tuple[str, ...]]:
    for record in axis.records:
        yield _merit(f"{record.name}, fitted", record.misfit, NANO)
    for one in axis.validations:
        yield _merit(f"{one.record}, held out", one.misfit, NANO)


def _merit(name: str, of: Misfit, scale: float) -> tuple[str, ...]:
    return name, f"{scale * of.sigma:.3g}", f"{scale * of.maximum:.3g}", f"{of.samples:,}"


def _discrepancies(found: Identification) -> Iterator[Rows]:
    for name, axis in found.axes.items():
        for one in axis.validations:
            known = one.model_discrepancy
            yield Rows(DISCREPANCY, list(_by_band(known)), f"{name}: {known.record}")


def _by_band(known: ModelDiscrepancy) -> Iterator[tuple[str, ...]]:
    bands = zip(known.bands, known.bands[1:], strict=False)
    values = zip(known.rms, known.noise, known.displacement, strict=True)
    for (low, high), (rms, noise, moved) in zip(bands, values, strict=True):
        share = f"{100 * rms / moved:.2f} %" if moved else "no motion"
        yield f"{low:g} to {high:g}", f"{NANO * rms:.2f}", f"{NANO * noise:.2f}", share
