"""Whatever becomes of the ROS side, or of the driver's own code, the outputs come to rest."""

from pathlib import Path

import pytest

from afm_scan_bench.faults.injection.drive import FAULTS, HANG, Fault, endanger

LIMIT = 20.0
"""Seconds on a machine that has other work; ``bench faults`` measures the time."""


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_the_outputs_come_to_rest(tmp_path: Path, fault: Fault) -> None:
    done = endanger(tmp_path / "scans" / "0", fault)
    assert done.broken == []
    assert done.drive > 1.0  # so that there was something to ramp down
    assert done.seconds < LIMIT < HANG
