"""Commands that scan by nodes, each a process: a scan whole, and refused before it moves."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import progress
from afm_scan_ros.cli.listening import ScanWatch
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.progress import showing
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.nodes.parameters import USUAL_WINDOW
from afm_scan_ros.nodes.peers import DONE, RUNNING
from afm_scan_ros.nodes.topics import BLOCKS
from helpers.scaling import scaled_axis
from helpers.viewers import assert_curves_are_recorded, assert_samples_are_of_the_streams


def files(spec: Path, bag: Path) -> ScanFiles:
    return ScanFiles(spec, CONFIG / "model.yaml", CONFIG / "plant.yaml", bag)


def test_the_slowest_node_says_how_far_a_scan_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "EVERY", 0.0)  # so that every step is told
    with showing("a scan") as shown:
        watch = ScanWatch(shown)
        watch.meet(SimpleNamespace(total_samples=1000))
        for node, state, sample in (
            ("trajectory_generator", "waiting", 0),
            ("scan_recorder", RUNNING, 0),
            ("trajectory_generator", RUNNING, 700),
            ("scan_recorder", RUNNING, 250),
        ):
            reported = {"node": node, "state": state, "next_sample": sample, "reason": ""}
            watch.hear(SimpleNamespace(**reported))
    assert capsys.readouterr().err.splitlines()[:4] == [
        "a scan: trajectory_generator: waiting (0 s)",
        "a scan: scan_recorder: running (0 s)",
        "a scan: trajectory_generator: running (0 s)",
        "a scan: 25%, sample 250 of 1000 (0 s)",
    ]


@pytest.mark.parametrize("heard", [(RUNNING,), (RUNNING, DONE), (DONE,)])
def test_an_alarm_is_told_once_also_of_a_node_that_is_met_late(
    capsys: pytest.CaptureFixture[str], heard: tuple[str, ...]
) -> None:
    with showing("a scan") as shown:
        watch = ScanWatch(shown)
        for state in heard:
            reported = {"node": "residual_monitor", "state": state, "reason": "an alarm"}
            watch.hear(SimpleNamespace(next_sample=0, **reported))
    assert capsys.readouterr().err.splitlines().count("residual_monitor: an alarm") == 1


def test_a_scan_is_recorded_whole_and_follows_what_was_desired(spec: Path, tmp_path: Path) -> None:
    run_scan(files(spec, tmp_path / "bag"), ("creep", "hysteresis", "vibration"))
    recording = read_scan(tmp_path / "bag")
    info = recording.info
    assert info.inverses == ("creep", "hysteresis", "vibration")
    streams = {name: recording.whole(name) for name in BLOCKS}
    assert {len(trace.x) for trace in streams.values()} == {info.total_samples}
    assert info.spec is not None
    lines = slice(phases(info.spec).lines.start, phases(info.spec).lines.stop)
    desired, achieved = streams["desired_displacement"], streams["achieved_displacement"]
    error = (achieved.x - desired.x)[lines]
    assert np.sqrt(np.mean(error**2)) < 0.01 * info.spec.range_x
    assert recording.warnings == ()
    assert_curves_are_recorded(tmp_path / "bag")
    assert_samples_are_of_the_streams(tmp_path / "bag", step=100)  # 200 a second of 20 kHz


def test_a_bag_is_never_overwritten(spec: Path, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    with pytest.raises(InputError, match="bag exists already"):
        run_scan(files(spec, tmp_path / "bag"), ("none",))


def test_a_scan_beyond_the_identified_range_is_refused_before_it_moves(
    spec: Path, tmp_path: Path
) -> None:
    text = spec.read_text("utf-8").replace("range_x_um: 10.0", "range_x_um: 90.0")
    spec.write_text(text, "utf-8")
    largest = r"the largest range of this scan: x \d\d\.\d µm, y 10 µm"
    with pytest.raises(ScanError, match=rf"inversion_compensator: sample \d+, axis x.*; {largest}"):
        run_scan(files(spec, tmp_path / "bag"), ("creep", "hysteresis", "vibration"))
    assert list(tmp_path.iterdir()) == [spec]  # so that a mended scan can have the bag's name


def test_a_scan_beyond_the_amplifier_is_refused_before_it_moves(spec: Path, tmp_path: Path) -> None:
    """The compensator alone knows of 5 V, the plant of less."""
    text = (CONFIG / "plant.yaml").read_text("utf-8")
    text = text.replace("\n  voltage_limit_v: 5.0", "\n  voltage_limit_v: 2.6")
    (plant := tmp_path / "plant.yaml").write_text(text, "utf-8")
    wide = "range_x_um: 45.0\n    preparation: none"
    spec.write_text(spec.read_text("utf-8").replace("range_x_um: 10.0", wide), "utf-8")
    given = ScanFiles(spec, CONFIG / "model.yaml", plant, tmp_path / "bag")
    with pytest.raises(ScanError, match=r"compensator: sample .* amplifier's 2\.6: .*x \d"):
        run_scan(given, ("creep", "hysteresis", "vibration"))
    assert sorted(tmp_path.iterdir()) == [plant, spec]


def test_the_window_holds_what_the_inverse_of_a_slow_scanner_looks_ahead(
    spec: Path, tmp_path: Path
) -> None:
    """Its first resonance is 11 Hz: its inverse looks ahead by half a second, a window by 0.4."""
    slow = load_model(CONFIG / "model.yaml")
    x, y = (scaled_axis(slow.axis(name), Scale(time=40.0)) for name in AXES)
    save_model(tmp_path / "slow.yaml", ScannerModel(x, y), "A slow scanner.")
    text = spec.read_text("utf-8").replace("    block_size: 500\n    window: 5000\n", "")
    spec.write_text(text.replace("10.0\n    range_y_um: 10.0", "0.1\n    range_y_um: 0.1"), "utf-8")
    given = ScanFiles(spec, tmp_path / "slow.yaml", CONFIG / "plant.yaml", tmp_path / "bag")
    run_scan(given, ("vibration",), 0.0)
    recording = read_scan(tmp_path / "bag")
    assert recording.info.window > USUAL_WINDOW * 400
    assert len(recording.whole("achieved_displacement").x) == recording.info.total_samples


def test_a_window_that_the_preview_does_not_fit_in_is_refused(spec: Path, tmp_path: Path) -> None:
    spec.write_text(spec.read_text("utf-8").replace("window: 5000", "window: 1100"), "utf-8")
    least = r"window = 1100 is less than the preview and two blocks: give at least 12\d\d"
    with pytest.raises(ScanError, match=least):
        run_scan(files(spec, tmp_path / "bag"), ("vibration",))
