"""The eight kinds of report, each of a small case that is made in this process."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.demo import IMAGED, LINE_RATES, cases, next_commands
from afm_scan_ros.core.closed_loop import FIRST, Round
from afm_scan_ros.core.comparison import compare_scans
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.identification.identify import identify_records
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.features.images.grating.models import Positions
from afm_scan_ros.features.images.grating.registered_image import ImageQuantity
from afm_scan_ros.features.images.identify import ImageIdentification
from afm_scan_ros.features.images.report import grating_report, grating_table
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.features.learning.loop import learn
from afm_scan_ros.features.learning.report import learning_report
from afm_scan_ros.features.survey.changes import changes
from afm_scan_ros.features.survey.page import Survey, survey_report
from afm_scan_ros.features.survey.recording import (
    EffectValue,
    NamedEffect,
    QuantityEstimate,
    Recording,
    SurveyedAxis,
)
from afm_scan_ros.report.analysis import analyse
from afm_scan_ros.report.close_loop import close_loop_report
from afm_scan_ros.report.diagnosis_page import diagnosis_report
from afm_scan_ros.report.fit_page import fit_report
from afm_scan_ros.report.page import CommandLine, Provenance, ReportPage, provenance_of, source_of
from afm_scan_ros.report.scan_pictures import (
    WITH,
    WITHOUT,
    TwoScans,
    comparison_picture,
    images_of,
    view_of,
)
from afm_scan_ros.report.scan_report import contributions, demo_report, scan_report, tracking
from afm_scan_ros.simulation.axis import detuned_axis
from helpers.fit_cases import OPERATORS, levels, record
from helpers.in_process import ALL, FAST_SPEC, InProcessSession, default_model, default_plant, scan

SPEC = evolve(FAST_SPEC, lines=6, preparation_cycles=3)
NOW = datetime(2026, 1, 1, tzinfo=UTC)
DAY = 86_400 * 10**9


def recorded(folder: Path, spec: ScanSpec = SPEC) -> Path:
    """Record a compensated scan of the default scanner, drive and true displacement included."""
    done = scan(spec, ALL)
    with ScanWriter(folder, info_of_scan(spec, "scan", 10**18)) as bag:
        bag.add("desired_displacement", done.desired)
        bag.add("drive_voltage", done.drive)
        bag.add("achieved_displacement", done.measured)
        bag.add("true_displacement", done.true)
    return folder


def of_scan(bag: Path) -> ReportPage:
    recording = read_scan(bag)
    return scan_report(analyse(recording), recording)


def of_demo(bag: Path) -> ReportPage:
    recording = read_scan(bag)
    done = dict.fromkeys(cases(), analyse(recording))
    tables = (tracking(done), contributions(done, LINE_RATES[1]))
    view = view_of(recording)
    compared = {rate: comparison_picture(f"{rate:g}hz", view, view) for rate in LINE_RATES}
    with_all, without = scan(SPEC, ALL), scan(SPEC, ())
    achieved = without.true, with_all.true
    images = images_of(TwoScans(SPEC, with_all.desired, achieved, "true", (WITHOUT, WITH)))
    commands = next_commands(Path("demo"))
    return demo_report(tables, compared, (IMAGED[0], images), commands, "in one process")


def of_identification() -> ReportPage:
    fitted = record(OPERATORS["plays"], levels(1, 14, 600))
    other = record(OPERATORS["plays"], levels(2, 8, 500))
    found = identify_records([fitted, evolve(other, name="check", kind="validation")])
    return fit_report(found, Path("model.yaml"))


@cache
def _diagnosed() -> tuple[ScannerDiagnosis, Scan]:
    """Diagnose a scan of a scanner whose gain in x has grown by 3 %."""
    done = scan(SPEC, ALL)
    grown = evolve(done.measured, x=1.03 * done.measured.x)
    observed = Record.of_traces("scan", done.drive, grown, SPEC, axes=("x",))
    return diagnose(default_model(), [observed]), done


def _provenance() -> Provenance:
    info = info_of_scan(SPEC, "scan", 10**18)
    return provenance_of("model.yaml", default_model(), [source_of("scan", info, 1000)], NOW)


def of_diagnosis() -> ReportPage:
    return diagnosis_report(report_residual(_diagnosed()[0]), _provenance())


def of_closed_loop() -> ReportPage:
    found, after = _diagnosed()
    true = evolve(after.true, x=1.03 * after.true.x)
    before = evolve(after, measured=evolve(after.measured, x=1.03 * after.measured.x), true=true)
    compared = compare_scans(default_model(), found.model, before, after)
    scans = {FIRST: before}, {FIRST: after}
    done = Round(default_model(), found, (), *scans, {FIRST: compared})
    return close_loop_report([done], _provenance())


def of_learning() -> ReportPage:
    plant = default_plant()
    plant = evolve(plant, **{n: detuned_axis(getattr(plant, n), 0.97, 0.97) for n in ("x", "y")})
    scans = list(learn(InProcessSession(plant), default_model(), SPEC, 4, plant.amplifier.limits))
    again = CommandLine("Scan again.", ["scan", "--learned", "learned.npz"])
    return learning_report(scans, None, _provenance(), [again])


def of_grating() -> ReportPage:
    """Of an image of stripes, which the scanner bends, and of the same ones without that."""
    size, pixels = 50e-6, 64
    place = (np.arange(pixels) + 0.5) / pixels
    bend = 2e-6 * place * (1.0 - place)
    x, y = np.meshgrid(size * place, size * place)

    def imaged(*shifts: np.ndarray) -> ScanImage:
        trace, retrace = (1e-7 * np.sin(2e6 * (x + shift + 0.2 * y)) for shift in shifts)
        return ScanImage(trace, retrace, size, size, line_time=1.0, name="stripes.gwy")

    before, after = imaged(bend, -bend), imaged(0.0 * bend, 0.0 * bend)
    moved = [np.stack([x + shift - size / 2, y - size / 2], axis=2) for shift in (bend, -bend)]
    positions = Positions(moved[0], moved[1], np.full(x.shape, 1e-9))
    figures = (ImageQuantity("loop width", "x", "%", 2.5, 2.4, 2.6),)
    found = ImageIdentification(
        afm.load_model(), (before,), (positions,), (after,), (figures,), drift=()
    )
    return grating_report(found, grating_table(found), ["x: known."], ["Record one."])


def recordings(count: int, instruments: int) -> list[Recording]:
    """Recordings of as many nights, of which the last instrument's gain in x grows by 1 %."""
    rng = np.random.default_rng(1)
    nights, last = count // instruments, instruments - 1
    return [
        _recording(f"afm{number}", night, rng, grown=number == last and night > nights / 2)
        for number in range(instruments)
        for night in range(nights)
    ]


def _recording(instrument: str, night: int, rng: np.random.Generator, *, grown: bool) -> Recording:
    axes = []
    for axis in ("x", "y"):
        gain = np.exp(3e-4 * rng.standard_normal()) * (1.01 if grown and axis == "x" else 1.0)
        ratio = np.exp(0.1 * rng.standard_normal())
        estimates = (
            QuantityEstimate("gain", float(gain), 3e-4, 6e-4),
            QuantityEstimate("residual_ratio", float(ratio), 0.1),
        )
        axes.append(SurveyedAxis(axis, 3e-9, 2e-9, estimates))
    value = EffectValue("gain", "1", 1.01, 1.009, 1.011)
    effect = NamedEffect("parameter_shift", "gain", "x", 0.99, (value,))
    return Recording(
        bag=f"/bags/{instrument}/night_{night:05d}",
        instrument=instrument,
        identity=f"{instrument}{night}",
        model="digest",
        version="1",
        recorded=(20_000 + night) * DAY,
        scan_id=f"{instrument} {night}",
        motion="one",
        samples=1000,
        sample_rate=1e4,
        verdict="effect_found" if grown else "model_sufficient",
        axes=tuple(axes),
        effects=(effect,) if grown else (),
    )


def of_survey(count: int = 400, instruments: int = 4) -> ReportPage:
    some = recordings(count, instruments)
    reports = {some[0].bag: "demo.html"}
    return survey_report(Survey(some, changes(some, 0.01), 0.01), reports, "model.yaml", NOW)


REPORTS: dict[str, Callable[[Path], ReportPage]] = {
    "analyze": of_scan,
    "demo": of_demo,
    "identify": lambda _: of_identification(),
    "diagnose": lambda _: of_diagnosis(),
    "close-loop": lambda _: of_closed_loop(),
    "learn": lambda _: of_learning(),
    "grating": lambda _: of_grating(),
    "survey": lambda _: of_survey(),
}
"""Each kind by the command that writes it, of the bag of a scan."""
