"""A scan with line feedback by nodes over DDS is the one within one process, bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.learning.fed_back_scan import fed_back_scan
from afm_scan_bench.learning.line_feedback import line_errors
from afm_scan_bench.scans import ALL
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant

CONFIG = share_directory() / "config"
PLANT = CONFIG / "changing/reversing_drift.yaml"
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 30.0, lines: 16, samples_per_line: 400, block_size: 700}
"""
AGE = 3.0


def test_nodes_correct_the_lines_as_one_process_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    (tmp_path / "scan.yaml").write_text(SPEC, "utf-8")
    files = ScanFiles(tmp_path / "scan.yaml", CONFIG / "model.yaml", PLANT, tmp_path / "bag")
    run_scan(files, ALL, further={"piezoscanner_sim": {"age_s": AGE}}, line_feedback=True)
    recorded = read_scan(tmp_path / "bag")
    assert recorded.info.spec is not None
    alone = fed_back_scan(recorded.info.spec, load_plant(PLANT), age=AGE, block_size=700)
    signals = {"drive_voltage": alone.drive, "achieved_displacement": alone.measured}
    for name, signal in signals.items():
        found = recorded.whole(name)
        np.testing.assert_array_equal(found.x, signal.x)
        np.testing.assert_array_equal(found.y, signal.y)
    before, after = line_errors(alone)[:, 0], line_errors(alone)[:, -1]
    assert np.all(after < 0.05 * before)
