"""A scan by nodes over DDS is the scan that the benches run in one process."""

from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.scans import ALL, scan
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.files import share_directory

CONFIG = share_directory() / "config"
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 100.0, lines: 4, samples_per_line: 400, block_size: 700}
"""


def test_nodes_give_what_one_process_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    (tmp_path / "scan.yaml").write_text(SPEC, "utf-8")
    files = ScanFiles(
        tmp_path / "scan.yaml", CONFIG / "model.yaml", CONFIG / "plant.yaml", tmp_path / "bag"
    )
    run_scan(files, ALL)
    recorded = read_scan(tmp_path / "bag")
    assert recorded.info.spec is not None
    alone = scan(recorded.info.spec, ALL)
    for axis in ("x", "y"):
        drive, true = (recorded.whole(name) for name in ("drive_voltage", "true_displacement"))
        np.testing.assert_allclose(drive.axis(axis), alone.drive.axis(axis), rtol=0, atol=1e-9)
        np.testing.assert_allclose(true.axis(axis), alone.true.axis(axis), rtol=0, atol=1e-14)
