"""Records from arrays and files lead to the same model and diagnosis as the commands' do."""

from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.diagnosis.candidates import CANDIDATES, CandidateFitter
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.identification.drives.excitation import (
    excitation_block,
    validation_plan,
)
from afm_scan_ros.core.identification.drives.experiments import KINDS, SWEEPS
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Trace
from helpers.in_process import ALL, Scan, default_model, scan

SPEC = afm.ScanSpec(lines=2, samples_per_line=1000, preparation_cycles=5, line_rate=10.0)


def record_of(drive: Trace, moved: Trace, axes: str, **further: object) -> afm.Record:
    columns = (np.column_stack([trace.axis(a) for a in axes]) for trace in (drive, moved))
    return afm.Record(*columns, drive.sample_period, tuple(axes), **further)


@pytest.fixture(scope="module")
def done() -> Scan:
    return scan(SPEC, ALL)


def bag_of(folder: Path, drive: Trace, moved: Trace, info: ScanInfo) -> Path:
    with ScanWriter(folder, info) as writer:
        writer.add("drive_voltage", drive)
        writer.add("achieved_displacement", moved)
    return folder


@pytest.mark.evidence
@pytest.mark.parametrize("kind", ["creep", "frequency", *SWEEPS])
def test_a_drive_is_recognised_whatever_its_size_and_sign(kind: str) -> None:
    plan = KINDS[kind]()
    drive = excitation_block(plan, 0, plan.total_samples)
    sized = 1e-3 * drive.x, -50.0 * drive.y
    assert set(map(recognised, sized)) == {"frequency" if kind in SWEEPS else kind}


def test_random_moves_and_a_scan_are_none_of_these(done: Scan) -> None:
    plan = validation_plan()
    moves = excitation_block(plan, 0, plan.total_samples)
    assert {recognised(moves.x), recognised(moves.y), recognised(done.drive.x)} == {None}


def drive_for(kind: str) -> afm.Record:
    drive = np.repeat([0.0, 0.5, 0.0], 500)
    return afm.Record(drive, 5e-6 * drive, 1e-2, kind=kind, name=f"{kind}.csv")


def test_records_that_make_no_identification_are_refused_by_name() -> None:
    few = afm.Record(np.arange(100.0), 1e-8 * np.arange(100.0), 1e-2)
    with pytest.raises(afm.InputError, match=r"x: record 1: holds only 100 samples: give .* 200"):
        afm.identify([few])
    with pytest.raises(afm.InputError, match="x: validation records alone fit nothing"):
        afm.identify([drive_for("validation")])
    with pytest.raises(afm.InputError, match="no record is given: give one at least"):
        afm.identify([])


def test_a_bag_and_a_table_hold_the_same_record(done: Scan, tmp_path: Path) -> None:
    info = info_of_scan(SPEC, "one", 1)
    from_bag = afm.read_record(bag_of(tmp_path / "bag", done.drive, done.measured, info))
    assert (from_bag.axes, from_bag.scan, from_bag.kind) == (("x", "y"), SPEC, None)
    table = np.column_stack((done.drive.x, done.measured.x))
    np.save(tmp_path / "x.npy", table)
    columns, rate = "drive_x=1:V,achieved_x=2:m", 1.0 / SPEC.sample_period
    from_table = afm.read_record(tmp_path / "x.npy", columns, sample_rate=rate)
    assert from_table.axes == ("x",)
    assert np.array_equal(from_table.drive[:, 0], from_bag.drive[:, 0])
    assert np.array_equal(from_table.displacement[:, 0], from_bag.displacement[:, 0])


@pytest.mark.parametrize(
    ("pattern", "axes", "kind"),
    [("chirp", ("x", "y"), "chirp"), ("creep_y_only", ("y",), "creep"), ("mine", ("x", "y"), None)],
)
def test_a_bag_says_what_its_record_is(
    done: Scan, tmp_path: Path, pattern: str, axes: tuple[str, ...], kind: str | None
) -> None:
    info = ScanInfo("one", 0, pattern, SPEC.sample_period, len(done.drive.x))
    found = afm.read_record(bag_of(tmp_path / "bag", done.drive, done.measured, info))
    assert (found.axes, found.kind, found.missing) == (axes, kind, 0)


def test_a_bag_cut_short_is_read_and_no_model_made_of_it(done: Scan, tmp_path: Path) -> None:
    info = ScanInfo("one", 0, "creep", SPEC.sample_period, len(done.drive.x) + 7)
    cut = afm.read_record(bag_of(tmp_path / "bag", done.drive, done.measured, info))
    assert cut.missing == 7
    others = [drive_for(kind) for kind in ("frequency", "hysteresis")]
    with pytest.raises(afm.InputError, match="the last 7 samples are missing; record it again"):
        afm.identify([cut, *others])


MODEL = afm.load_model()
ALONE = afm.Model(ScannerModel(x=default_model().x), "x alone")


@pytest.fixture(scope="module")
def alone(done: Scan) -> afm.Diagnosis:
    """The diagnosis of x by a model of x."""
    return afm.diagnose(ALONE, [record_of(done.drive, done.measured, "x", scan=SPEC)])


@pytest.mark.evidence
def test_one_axis_is_diagnosed_as_the_same_axis_of_both(done: Scan, alone: afm.Diagnosis) -> None:
    of_both = afm.diagnose(MODEL, [record_of(done.drive, done.measured, "xy", scan=SPEC)])
    x = record_of(done.drive, done.measured, "x", scan=SPEC)
    for found in (alone, afm.diagnose(MODEL, [x])):
        before, both = (f.scanner_diagnosis.rms_before for f in (found, of_both))
        assert before == {"x": both["x"]}
        assert found.verdict == of_both.verdict == "model_sufficient"
    assert set(of_both.scanner_diagnosis.rms_before) == {"x", "y"}


def test_a_diagnosis_of_one_axis_is_saved(alone: afm.Diagnosis, tmp_path: Path) -> None:
    alone.save(tmp_path / "out", "svg")
    extended = afm.load_model(tmp_path / "out/model.extended.yaml")
    assert extended.axes == alone.model.axes == ("x",)
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert {"diagnosis.json", "report.html", "report_residual_x.svg"} <= names
    assert "report_residual_y.svg" not in names


def test_records_and_a_model_that_share_no_axis_are_refused(done: Scan) -> None:
    y = record_of(done.drive, done.measured, "y", name="of y")
    with pytest.raises(afm.InputError, match=r"no axis is in the model \(x\) and .* \(of y: y\)"):
        afm.diagnose(ALONE, [y])


def seen(
    done: Scan, model: ScannerModel, first: int = 0, start: str = "unknown"
) -> CandidateFitter:
    drive, moved = (
        Trace(0, t.sample_period, t.x[first:], t.y[first:]) for t in (done.drive, done.measured)
    )
    observed = Record.of_traces("scan", drive, moved, start=start)
    return CandidateFitter((evidence_of("x", model, observed),), chain_of(model.axis("x")))


def test_no_coupling_to_an_absent_axis_is_tried(done: Scan) -> None:
    for model, coupled in ((ALONE.scanner, False), (MODEL.scanner, True)):
        bench = seen(done, model)
        view = bench.evidence[0].playback.view
        residual = bench.evidence[0].residual(bench.chain)
        features = ResidualFeatures(
            view.sample_period, view.drive, view.measured, residual, view.other, ()
        )
        static, other = (
            next(c for c in CANDIDATES if c.effect.name == name)
            for name in ("cross_coupling", "static_nonlinearity")
        )
        assert (bench.begin(None, static, features) is not None) == coupled
        assert bench.begin(None, other, features) is not None


def test_a_record_known_to_begin_depolarised_is_not_doubted(done: Scan) -> None:
    """Cut out of a scan it does not begin so, which its first turns show."""
    middle = len(done.drive.x) // 2
    begun = (seen(done, ALONE.scanner, middle, start=s) for s in ("unknown", "depolarised"))
    estimated, stated = (bench.evidence[0].playback.initial_state.blank for bench in begun)
    assert (estimated, stated) == (False, True)
