"""A scan beside its view, in real processes: the view shows it, and costs it nothing."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.core.streams import monitor_step
from afm_scan_ros.features.view.viewer import ViewSettings
from helpers.viewed import command, curve, feeder_of, let_go_on, news, recorded, states

pytest.importorskip("rerun", reason="the viewer is not installed: pip install 'afm_scan_ros[view]'")

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 10.0, line_rate_hz: 20.0, lines: 20,
    samples_per_line: 5000, preparation_cycles: 1, scan_id: one}
"""
LONGER = ViewSettings().closing + 10.0
"""Seconds that a scan may take longer beside a view, on a machine that does much else."""


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("spec") / "scan.yaml"
    path.write_text(SPEC, "utf-8")
    return path


@pytest.fixture(scope="module")
def plain(spec: Path) -> np.ndarray:
    """Samples of the scan without a view."""
    bag = spec.parent / "plain"
    scan = command("scan", "--spec", spec, "--time-scale", 1, "--bag", bag)
    _, said = scan.communicate()
    assert scan.returncode == 0, said
    return recorded(bag)


@pytest.mark.evidence
def test_a_file_shows_what_the_bag_holds(spec: Path, plain: np.ndarray, tmp_path: Path) -> None:
    bag, file = tmp_path / "bag", tmp_path / "scan.rrd"
    scan = command("scan", "--spec", spec, "--bag", bag, "--watch", "--view", file)
    _, said = scan.communicate()
    assert scan.returncode == 0, said
    samples, info = recorded(bag), read_scan(bag).info
    np.testing.assert_array_equal(samples, plain)
    step = monitor_step(info.sample_period)
    times, shown = curve(file, "/displacement/achieved/x")
    np.testing.assert_allclose(times, np.arange(0, info.total_samples, step) * info.sample_period)
    np.testing.assert_allclose(shown, 1e6 * samples[2, 0, ::step])
    _, errors = curve(file, "/error/y")
    np.testing.assert_allclose(errors, 1e9 * (samples[2, 1, ::step] - samples[0, 1, ::step]))
    for path in ("/lines/error/rms_x", "/lines/residual/max_y"):
        assert len(curve(file, path)[1]) == 20
    assert news(file) == ["the scan is done"]
    assert f"| scan | done | {info.total_samples} (100%) |" in states(file)


@pytest.mark.parametrize(
    "number",
    [
        pytest.param(signal.SIGKILL, id="killed"),
        pytest.param(signal.SIGSTOP, id="stopped", marks=pytest.mark.evidence),
    ],
)
def test_a_view_that_falls_out_changes_no_sample(
    spec: Path, plain: np.ndarray, tmp_path: Path, number: signal.Signals
) -> None:
    bag, file = tmp_path / "bag", tmp_path / "scan.rrd"
    scan = command("scan", "--spec", spec, "--time-scale", 1, "--bag", bag, "--view", file)
    while not bag.exists():
        assert scan.poll() is None
        time.sleep(0.01)
    time.sleep(0.3)
    feeder = feeder_of(scan.pid)
    os.kill(feeder, number)
    began = time.monotonic()
    _, said = scan.communicate()
    let_go_on(feeder)
    assert scan.returncode == 0, said
    total = read_scan(bag).info
    assert time.monotonic() - began < total.total_samples * total.sample_period + LONGER
    np.testing.assert_array_equal(recorded(bag), plain)


@pytest.mark.evidence
def test_a_scan_that_fails_says_why_in_its_view(spec: Path, tmp_path: Path) -> None:
    bag, file = tmp_path / "bag", tmp_path / "scan.rrd"
    scan = command("scan", "--spec", spec, "--time-scale", 1, "--bag", bag, "--view", file)
    while not bag.exists():
        assert scan.poll() is None
        time.sleep(0.01)
    time.sleep(1.0)
    scan.send_signal(signal.SIGINT)
    scan.communicate()
    assert scan.returncode == 130
    deadline = time.monotonic() + 20.0
    while not (said := news(file)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert said == ["the scan has failed: interrupted"]
