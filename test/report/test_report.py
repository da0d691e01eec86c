"""A recorded scan, analysed: terminal, JSON, report and picture, and what ends badly."""

import json
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.report.analysis import analyse
from afm_scan_ros.report.paper import paper_figure, save
from afm_scan_ros.report.quantity import nanometres
from afm_scan_ros.report.scan_pictures import comparison_picture, tracking_picture, view_of
from afm_scan_ros.report.scan_report import error_rows, scan_report
from afm_scan_ros.report.whole_scan import whole_pictures

OFFSET = 10e-9
NOISE = 2e-9
BLOCK = 700


def record(
    folder: Path, pattern: str = "raster", stop: int | None = None, line_rate: float = 50.0
) -> Path:
    """Record a scan whose true error is an offset, measured with noise."""
    spec = ScanSpec(
        pattern=pattern, line_rate=line_rate, lines=6, samples_per_line=400, preparation="none"
    )
    info = info_of_scan(spec, "scan-1", 10**18)
    rng = np.random.default_rng(5)
    with ScanWriter(folder, info) as writer:
        for first in range(0, stop or total_samples(spec), BLOCK):
            block = desired(spec, first, min(BLOCK, total_samples(spec) - first))
            true = Trace(first, block.sample_period, block.x + OFFSET, block.y - OFFSET)
            x, y = NOISE * rng.normal(size=(2, block.x.size))
            writer.add("desired_displacement", block)
            drive = Trace(first, block.sample_period, 1e5 * block.x, 1e5 * block.y)
            writer.add("drive_voltage", drive)
            achieved = Trace(first, block.sample_period, true.x + x, true.y + y)
            writer.add("achieved_displacement", achieved)
            writer.add("true_displacement", true)
    return folder


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("bags") / "bag")


def afm_scan(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> object:
    """Run the command; return its exit status."""
    monkeypatch.setattr("sys.argv", ["afm-scan", "analyze", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return ended.value.code


def test_the_analysis_separates_true_from_measured(bag: Path) -> None:
    analysis = analyse(read_scan(bag))
    assert analysis.shortcomings == ()
    assert analysis.true is not None
    assert analysis.true.x.constant_speed is not None
    assert analysis.measured.x.constant_speed is not None
    assert analysis.true.x.constant_speed.rms == pytest.approx(OFFSET)
    expected = np.hypot(OFFSET, NOISE)
    assert analysis.measured.x.constant_speed.rms == pytest.approx(expected, rel=0.02)
    assert analysis.measured.x.repeatability == pytest.approx(NOISE, rel=0.05)
    assert analysis.drive is not None
    assert (analysis.drive.lowest_x, analysis.drive.highest_y) == pytest.approx((-2.0, 2.0))


def test_the_command_writes_the_same_figures_everywhere(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / name for name in ("a.json", "a.html", "a.png")]
    options = zip(("--json", "--report", "--figure"), files, strict=True)
    status = afm_scan(monkeypatch, bag, *(word for option in options for word in option))
    assert status in (0, None)
    figures = json.loads(files[0].read_text("utf-8"))
    rms = figures["true"]["x"]["constant_speed"]["rms_m"]
    assert rms == pytest.approx(OFFSET)
    for text in (capsys.readouterr().out, files[1].read_text("utf-8")):
        assert "x, constant speed" in text
        assert nanometres(rms) in text
    assert files[2].read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("option", ["--json", "--report", "--figure"])
def test_a_recording_is_never_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    folder = record(tmp_path / "bag")
    kept = {file: file.read_bytes() for file in folder.iterdir()}
    for file in kept:
        assert afm_scan(monkeypatch, folder, option, file) == 2
    (data,) = folder.glob("*.mcap")
    assert afm_scan(monkeypatch, data, option, data) == 2
    assert {file: file.read_bytes() for file in folder.iterdir()} == kept


@pytest.mark.evidence
def test_figures_are_written_beside_the_report(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert afm_scan(monkeypatch, bag, "--figures", "svg") == 2
    afm_scan(monkeypatch, bag, "--report", tmp_path / "a.html", "--figures", "svg")
    figures = sorted(tmp_path.glob("*.svg"))
    assert [file.stem for file in figures] == ["a_by_line", "a_lines", "a_whole"]
    assert all(file.read_text("utf-8").startswith("<?xml") for file in figures)


def test_a_scan_that_stops_early_is_reported_and_ends_with_status_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = record(tmp_path / "bag", stop=8 * BLOCK)
    assert afm_scan(monkeypatch, bag, "--json", tmp_path / "a.json") == 3
    captured = capsys.readouterr()
    assert "incomplete: it has 5600 of" in captured.err
    assert "x, constant speed" in captured.out
    assert json.loads((tmp_path / "a.json").read_text("utf-8"))["shortcomings"]


def test_an_incomplete_scan_states_its_error_over_the_planned_range(tmp_path: Path) -> None:
    """Four of five steps in y are made, and the share is that of the whole scan."""
    recording = read_scan(record(tmp_path / "bag", stop=5 * BLOCK))
    analysis = analyse(recording)
    assert analysis.true is not None
    assert analysis.true.y.peak_to_peak == pytest.approx(0.8 * analysis.true.y.planned_range)
    rows = {row[0]: row for row in error_rows(analysis.true)}
    assert rows["y, on trace"][2] == "0.025"
    answer, *_ = scan_report(analysis, recording).answer
    assert "nm rms in y on trace (0.025 % of the planned 40 µm)" in str(answer)


def test_a_cut_file_warns_and_ends_with_status_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = record(tmp_path / "bag", line_rate=2.0)
    content = (bag / "bag_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) - 100])
    status = afm_scan(monkeypatch, tmp_path / "cut.mcap")
    warning = capsys.readouterr().err
    assert "warning:" in warning
    assert "ros2 bag reindex" in warning
    assert status in (0, None)  # only the index is missing: every sample is there
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 4 // 5])
    assert afm_scan(monkeypatch, tmp_path / "cut.mcap") == 3


def test_a_calibration_record_is_sent_to_identify(tmp_path: Path) -> None:
    with ScanWriter(tmp_path / "bag", ScanInfo("c", 0, "creep", 1e-3, 10)):
        pass
    with pytest.raises(InputError, match=r"'creep'.*afm-scan identify"):
        analyse(read_scan(tmp_path / "bag"))


def test_trace_and_retrace_have_one_scale_of_colours(bag: Path) -> None:
    _, by_line = whole_pictures(read_scan(bag))
    trace, retrace = (panel.maps[0] for panel in by_line.rows[0])
    assert (trace.low, trace.high) == (retrace.low, retrace.high)
    assert trace.high == max(np.abs(trace.values).max(), np.abs(retrace.values).max())
    assert by_line.lines == 6


@pytest.mark.evidence
@pytest.mark.parametrize("pattern", PATTERNS)
def test_every_pattern_can_be_drawn(tmp_path: Path, pattern: str) -> None:
    view = view_of(read_scan(record(tmp_path / "bag", pattern)))
    assert view.desired.x.size == 3 * view.spec.samples_per_line
    assert np.allclose(view.achieved.x - view.desired.x, OFFSET, atol=1e-15)
    figure = paper_figure(tracking_picture(view))
    assert all(panel.get_xlabel() or panel.get_ylabel() for panel in figure.axes)
    save(figure, tmp_path / "a.png")
    save(paper_figure(comparison_picture("30hz", view, view)), tmp_path / "b.svg")
    assert (tmp_path / "b.svg").read_text("utf-8").startswith("<?xml")


def test_an_unknown_kind_of_picture_is_refused(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.docx: unknown kind of picture"):
        save(paper_figure(tracking_picture(view_of(read_scan(bag)))), tmp_path / "a.docx")


def test_a_row_gives_rms_and_largest_in_nm_and_percent(bag: Path) -> None:
    true = analyse(read_scan(bag)).true
    assert true is not None
    rows = {row[0]: row[1:] for row in error_rows(true)}
    assert rows["x, all"] == ("10.0", "0.025", "10.0", "0.025")
    assert rows["y, over the step"] == ("10.0", "0.025", "10.0", "0.025")
