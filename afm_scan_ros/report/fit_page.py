"""The fit report: what was fitted on what, how well, as a page and as JSON, ``MODEL.fit.json``."""

from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from attrs import asdict

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.identification.findings import Finding
from afm_scan_ros.core.identification.identify import FittedAxis, FittedRecord, Identification
from afm_scan_ros.core.identification.records.recording import Misfit
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, Status
from afm_scan_ros.core.types import Array, Complex
from afm_scan_ros.report.page import CommandLine, Part, ReportPage, Section
from afm_scan_ros.report.picture import (
    BLUE,
    DARK_GREY,
    LIGHT_BLUE,
    LIGHT_ORANGE,
    MICRO,
    MILLI,
    NANO,
    ORANGE,
    Curve,
    Mark,
    Panel,
    Picture,
    Steps,
)
from afm_scan_ros.report.sentences import intervals_text, sentence, status_text
from afm_scan_ros.report.table import Rows


def finding_text(finding: Finding) -> str:
    """Say what was found and what to do about it."""
    return sentence(f"finding.{type(finding).__name__}", of=finding)


def fit_summary(identification: Identification) -> dict[str, Any]:
    """Return the fit report by axis: what was fitted, figures of merit, warnings.

    Misfits are those of the paper's Eqs. 2 and 3 (creep and vibration with hysteresis, m), and of
    its Eqs. 18 and 19 (direct inverse, V). Intervals are of 95 %.
    """
    return {name: _axis(axis) for name, axis in identification.axes.items()}


def _axis(found: FittedAxis) -> dict[str, Any]:
    model = found.model
    return {
        "records": {one.name: _misfit(one.misfit, "m") for one in found.records},
        "held_out": {one.record: _misfit(one.misfit, "m") for one in found.validations},
        "operator": found.operator,
        "output_map": model.hysteresis.output is not None,
        "direct_inverse": _misfit(found.direct, "v"),
        "creep": {"gains": model.creep.gains, "time_constants_s": model.creep.time_constants},
        "sensor": model.sensor and asdict(model.sensor),
        "discrepancy_over_motion": found.discrepancy,
        "scan_deviation_over_range": found.deviation,
        "effects": asdict(model.effects, value_serializer=_plain),
        "model_discrepancy": [_model_discrepancy(o.model_discrepancy) for o in found.validations],
        "warnings": [finding_text(finding) for finding in found.warnings],
    }


def _plain(_owner: Any, _field: Any, value: Any) -> Any:  # noqa: ANN401 - attrs' own
    return value.value if isinstance(value, Status) else value


def _model_discrepancy(known: ModelDiscrepancy) -> dict[str, Any]:
    return {
        "record": known.record,
        "bands_hz": known.bands,
        "rms_m": known.rms,
        "noise_rms_m": known.noise,
        "displacement_rms_m": known.displacement,
    }


def _misfit(misfit: Misfit, unit: str) -> dict[str, float]:
    return {f"sigma_{unit}": misfit.sigma, f"max_{unit}": misfit.maximum, "samples": misfit.samples}


KNOWN = ("", "known, and where it holds", "95 % intervals")
LEFT = ("measured less model", "sigma, nm", "max, nm", "samples")
DIRECT = ("drive of the inverse less that of the records", "sigma, mV", "max, mV", "samples")
DISCREPANCY = ("band, Hz", "discrepancy, nm rms", "noise, nm rms", "discrepancy / motion")


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
            Section("Model discrepancy", [sentence("fit.method"), *_discrepancies(found)]),
        ],
    )


def _answer(found: Identification) -> Iterator[str]:
    shares = {name: axis.deviation for name, axis in found.axes.items()}
    yield sentence("fit.prediction", shares=shares)
    left = {n: one.misfit.sigma for n, axis in found.axes.items() for one in axis.validations[:1]}
    yield sentence("fit.held_out" if left else "fit.none_held_out", left=left)


def _next(model: Path) -> Iterator[CommandLine]:
    bag, diagnosis = (model.with_name(f"{model.stem}_{name}") for name in ("scan", "diagnosis"))
    scan = ["scan", "--model", model, "--bag", bag]
    yield CommandLine(sentence("fit.scan"), scan)
    diagnose = ["diagnose", bag, "--model", model, "--out", diagnosis]
    yield CommandLine(sentence("fit.diagnose"), diagnose)


def _fits(found: Identification) -> Iterator[Part]:
    yield sentence("fit.merits")
    for name, axis in found.axes.items():
        yield sentence("fit.operator", name=name, operator=axis.operator)
        fitted = [_merit(f"{each.name}, fitted", each.misfit, NANO) for each in axis.records]
        held_out = [_merit(f"{e.record}, held out", e.misfit, NANO) for e in axis.validations]
        yield Rows(LEFT, [*fitted, *held_out], f"Axis {name}")
        direct = _merit("direct inverse of the hysteresis", axis.direct, MILLI)
        yield Rows(DIRECT, [direct])


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


COLOURS = (LIGHT_BLUE, LIGHT_ORANGE, DARK_GREY)
"""Of records, in turn."""
COHERENCE = 0.9
"""Least coherence of a measured line that is drawn."""
POINTS = 400
"""Points of a model's curve."""
HALF_TURN = 180.0
"""Degrees from one point to the next at which a curve of the phase is cut."""
HERTZ = "frequency in Hz"


def _coloured(found: FittedAxis) -> Iterator[tuple[FittedRecord, str]]:
    return zip(found.records, cycle(COLOURS), strict=False)


def _response(model: AxisModel, frequency: Array, sample_period: float) -> Complex:
    """Complex response (m/V) from F to what the sensor reads, creep included, at Hz."""
    omega = 2.0 * np.pi * frequency
    gains, constants = np.array(model.creep.gains), np.array(model.creep.time_constants)
    creep = 1.0 + np.sum(gains / (1.0 + 1j * omega[:, np.newaxis] * constants), axis=1)
    return np.asarray(creep * held(model.read_vibration, sample_period).response(omega))


def _magnitude(name: str, found: FittedAxis) -> Panel:
    marks = _responses(found, lambda response: MICRO * np.abs(response))
    return Panel(marks, HERTZ, "response to F in µm/V", f"{name}: magnitude", "xy")


def _phase(name: str, found: FittedAxis) -> Panel:
    marks = _responses(found, lambda response: np.degrees(np.angle(response)))
    return Panel(marks, HERTZ, "phase in degrees", f"{name}: phase", "x")


def _responses(found: FittedAxis, of: Callable[[Complex], Array]) -> list[Mark]:
    """Return a figure ``of`` the responses of all records, and of the model over their band."""
    marks: list[Mark] = []
    for record, colour in _coloured(found):
        measured = record.response
        clear = measured.coherence > COHERENCE
        seen = of(measured.response[clear])
        marks.append(Curve(measured.frequency[clear], seen, record.name, colour, dots=True))
    shortest = min(found.records, key=lambda record: record.sample_period)
    highest = 0.5 / shortest.sample_period
    lowest = min(float(r.response.frequency.min(initial=highest)) for r in found.records)
    frequency = np.geomspace(min(lowest, 0.01 * highest), highest, POINTS)
    curve = of(_response(found.model, frequency, shortest.sample_period))
    turned = np.abs(np.diff(curve, prepend=curve[0])) > HALF_TURN
    return [*marks, Curve(frequency, np.where(turned, np.nan, curve), "model", BLUE)]


def _creep(name: str, found: FittedAxis) -> Panel:
    creep = found.model.creep
    held_for = np.geomspace(1e-4, 3.0, POINTS) * max(creep.time_constants, default=1.0)
    grown = -np.expm1(-held_for[:, np.newaxis] / np.array(creep.time_constants))
    curve = Curve(held_for, 100.0 * grown @ np.array(creep.gains))
    label = "creep in % of the step"
    return Panel([curve], "time since a step in s", label, f"{name}: creep after a step", "x")


def _loops(name: str, found: FittedAxis) -> Panel:
    curves = [
        Curve(record.drive, record.effective, record.name, colour, width=0.6)
        for record, colour in _coloured(found)
    ]
    return Panel(curves, "drive u in V", "effective input F in V", f"{name}: loops")


def _left(name: str, found: FittedAxis) -> Panel:
    curves = [
        Curve(record.seconds / record.seconds[-1], NANO * record.left, record.name, colour)
        for record, colour in _coloured(found)
    ]
    for one in found.validations:
        share = np.linspace(0.0, 1.0, len(one.residual))
        curves.append(Curve(share, NANO * one.residual, f"{one.record}, held out", ORANGE))
    label = "measured less model in nm"
    return Panel(curves, "time over the record's length", label, f"{name}: left of each record")


def _bands(name: str, found: FittedAxis) -> Panel:
    known = found.model.model_discrepancies[0]
    lines = {
        "motion": (known.displacement, ORANGE),
        "left by the model": (known.rms, BLUE),
        "sensor noise": (known.noise, DARK_GREY),
    }
    edges, steps = np.maximum(known.bands, known.bands[1] / 10.0), []
    for label, (rms, colour) in lines.items():
        shown = NANO * np.where(np.array(rms) >= min(known.noise), rms, np.nan)
        steps.append(Steps(edges, shown, label, colour))
    which = "fitted" if known.fitted else "held out"
    return Panel(steps, HERTZ, "rms in nm", f"{name}: {which}, rms by band", "xy")


PANELS = {"fit": (_bands, _left), "response": (_magnitude, _phase), "slow": (_creep, _loops)}


def fit_picture(found: Identification, name: str) -> Picture:
    """Return the picture of a name among ``PANELS``, with a row for each axis."""
    rows = [[draw(axis, of) for draw in PANELS[name]] for axis, of in found.axes.items()]
    return Picture(name, sentence(f"caption.{name}"), rows)
