"""A scan with adaptation by nodes over DDS is the one within one process, bit for bit.

And the monitor states what changed.
"""

from collections import deque
from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.scans import ALL, SEED, default_model
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.streams import ACHIEVED, DRIVE, end, part
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.features.online.adaptation import Adaptation
from afm_scan_ros.features.online.adapted_scan import AdaptedScan
from afm_scan_ros.features.online.line_correction import lines_of_delay
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner

CONFIG = share_directory() / "config"
PLANT = CONFIG / "changing/exchanged_sample.yaml"
SPEC = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 100.0, lines: 40, samples_per_line: 500, turnaround: 0.2}
"""
AGE, MEMORY, BLOCK = 700.0, 0.1, 1000


def test_nodes_adapt_as_one_process_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    (tmp_path / "scan.yaml").write_text(SPEC, "utf-8")
    files = ScanFiles(tmp_path / "scan.yaml", CONFIG / "model.yaml", PLANT, tmp_path / "bag")
    memory = {"adapt_time_constant_s": MEMORY}
    further = {"inversion_compensator": memory, "residual_monitor": memory}
    further |= {"piezoscanner_sim": {"age_s": AGE}}
    run_scan(files, ALL, further=further, watched=True, adapt=True)
    said = "".join(capfd.readouterr())
    assert "x: by line 10 the frequency is changed: 0.97" in said
    recorded = read_scan(tmp_path / "bag")
    spec = recorded.info.spec
    assert spec is not None
    drive = recorded.whole("drive_voltage")
    plant = load_plant(PLANT)
    limits = plant.amplifier.limits
    compensation = Compensation(default_model(), spec.sample_period, ALL, InverseSettings(), limits)
    scanner = Piezoscanner(plant, spec.sample_period, SEED, AGE)
    adaptation = Adaptation(default_model(), spec, MEMORY)
    delay = lines_of_delay(spec, compensation.held_back)
    adapted = AdaptedScan(default_model(), spec, adaptation, delay)
    progress, target = compensation.at_rest(), desired(spec, 0, total_samples(spec))
    for first in range(0, len(target.x), BLOCK):
        block = part(target, first, min(first + BLOCK, len(target.x)))
        waiting = deque(adapted.corrected([block]))
        while waiting:
            block = waiting.popleft()
            progress, now = compensation.invert(progress, block)
            if not len(now.x):
                continue
            found = part(drive, now.first_sample, end(now))
            np.testing.assert_array_equal(found.x, now.x)
            np.testing.assert_array_equal(found.y, now.y)
            adapted.observe(DRIVE, now)
            adapted.observe(ACHIEVED, scanner.advance(now)[0])
            waiting.extend(adapted.corrected())
    assert adaptation.states["x"].shift.frequency == pytest.approx(1.05**-0.5, abs=2e-3)
