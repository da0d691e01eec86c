"""A command's scan that is watched by the monitor."""

from pathlib import Path

import pytest

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.model import INVERSES

pytestmark = pytest.mark.long

LINES = 6
NAME = "residual_monitor"


def test_a_watched_scan_tells_its_alarm_and_records_each_line(
    spec: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    plant, bag = CONFIG / "plants/delay_large.yaml", tmp_path / "bag"
    run_scan(ScanFiles(spec, CONFIG / "model.yaml", plant, bag), INVERSES, watched=True)
    said = [line for line in capfd.readouterr().err.splitlines() if line.startswith(f"{NAME}: ")]
    assert len(said) == 1
    assert said[0].endswith("Diagnose this scan's bag")
    topics = [message.topic for message in messages(bag / "bag_0.mcap")]
    assert topics.count("/model_residual") == LINES
