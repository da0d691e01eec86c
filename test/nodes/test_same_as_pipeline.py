"""A scan by nodes is the scan that the pipeline makes in one process, bit for bit."""

from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.typestore import decode
from afm_scan_ros.cli import execution
from afm_scan_ros.cli.driving import DrivenScanner
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import INVERSES

pytest.importorskip("rclpy")

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 100.0, lines: 40, samples_per_line: 500, turnaround: 0.2,
    block_size: 700, scan_id: one}
"""
EQUAL = {
    *("/desired_displacement", "/drive_voltage", "/achieved_displacement", "/true_displacement"),
    *("/tracking_error", "/model_residual"),
}
"""Topics; viewers need not get all of /monitor, and no node takes part in the pipeline's scan."""


def sent(bag: Path) -> dict[str, list[object]]:
    """Return the numbers of each topic of a bag, however its samples are cut into blocks."""
    found: dict[str, list[object]] = {}
    for file in sorted(bag.glob("*.mcap")):
        for message in messages(file):
            fields = decode(message.type_name, message.cdr)
            numbers = found.setdefault(message.topic, [])
            if hasattr(fields, "last"):
                numbers += zip(fields.x.tolist(), fields.y.tolist(), strict=True)
            elif hasattr(fields, "line"):
                rms, largest = (fields.rms_x, fields.rms_y), (fields.max_x, fields.max_y)
                numbers.append((fields.line, *rms, *largest))
    return found


@pytest.mark.parametrize("corrected", [False, True])
def test_a_scan_is_the_same_to_the_bit(tmp_path: Path, *, corrected: bool) -> None:
    spec, plant = tmp_path / "scan.yaml", CONFIG / "changing/exchanged_sample.yaml"
    spec.write_text(SPEC, "utf-8")
    for nodes in (True, False):
        files = ScanFiles(spec, CONFIG / "model.yaml", plant, tmp_path / f"nodes_{nodes}")
        with mock.patch.object(execution, "nodes_can_run", lambda nodes=nodes: nodes):
            run_scan(files, INVERSES, watched=True, line_feedback=corrected, adapt=corrected)
    by_nodes, alone = (sent(tmp_path / f"nodes_{nodes}") for nodes in (True, False))
    assert by_nodes.keys() == alone.keys() > EQUAL
    for topic in EQUAL:
        assert by_nodes[topic] == alone[topic], topic
    one, other = (read_scan(tmp_path / f"nodes_{nodes}").info for nodes in (True, False))
    for name in ("scan_id", "spec", "total_samples", "inverses", "model_hash", "window"):
        assert getattr(one, name) == getattr(other, name)


def test_a_record_is_the_same_to_the_bit(tmp_path: Path) -> None:
    plan = EXPERIMENTS["rest"].plan()
    for nodes in (True, False):
        with mock.patch.object(execution, "nodes_can_run", lambda nodes=nodes: nodes):
            DrivenScanner(seed=3).record(plan, tmp_path / f"nodes_{nodes}", "rest")
    one, other = (read_scan(tmp_path / f"nodes_{nodes}") for nodes in (True, False))
    assert set(one.topics) == set(other.topics)
    for name in ("drive_voltage", "achieved_displacement", "true_displacement"):
        for axis in ("x", "y"):
            samples = (bag.whole(name).axis(axis) for bag in (one, other))
            np.testing.assert_array_equal(*samples)
