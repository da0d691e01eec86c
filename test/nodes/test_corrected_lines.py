"""Line feedback by nodes: a drift that the model does not know is followed."""

from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.streams import part
from afm_scan_ros.core.trajectory import phases

pytestmark = pytest.mark.long

SPEC = """\
/**/trajectory_generator:
  ros__parameters:
    {line_rate_hz: 20.0, lines: 14, samples_per_line: 500, preparation_cycles: 5, window: 700}
"""
ALL = ("creep", "hysteresis", "vibration")


def test_a_drift_is_followed_with_a_window_shorter_than_the_delay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    (tmp_path / "scan.yaml").write_text(SPEC, "utf-8")
    plant = CONFIG / "changing/settling_drift.yaml"
    files = ScanFiles(tmp_path / "scan.yaml", CONFIG / "model.yaml", plant, tmp_path / "bag")
    run_scan(files, ALL, 0.0, line_feedback=True)
    recorded = read_scan(tmp_path / "bag")
    assert recorded.info.spec is not None
    where = phases(recorded.info.spec).lines
    desired, true = (
        part(recorded.whole(name), where.start, where.stop)
        for name in ("desired_displacement", "true_displacement")
    )
    for axis in ("x", "y"):
        error = (true.axis(axis) - desired.axis(axis)).reshape(14, 500)
        first, *_, last = np.sqrt(np.mean(error[:, 30:220] ** 2, axis=1))
        assert last < 0.1 * first
