"""What a good model leaves of a scan lies at the floor that is foretold of it."""

import pytest
from attrs import evolve

from afm_scan_ros.bench.laboratory import InProcess
from afm_scan_ros.bench.scans import default_model, default_plant
from afm_scan_ros.core.closed_loop.trials import SAME
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.tracing.gathering import gathered
from afm_scan_ros.core.tracing.observation import Observation
from afm_scan_ros.core.tracing.selection import AT_FLOOR
from afm_scan_ros.core.types import AXES

SCAN = ScanSpec(line_rate=20.0, samples_per_line=500, lines=6, range_x=30e-6, range_y=30e-6)


@pytest.mark.parametrize("pattern", ["raster", "spiral"])
@pytest.mark.parametrize("lines", [6, 100])
def test_a_healthy_scanner_scans_at_its_floor_however_long(pattern: str, lines: int) -> None:
    spec = evolve(SCAN, pattern=pattern, lines=lines)
    model = default_model()
    done = InProcess(default_plant(), 3).scan(SAME, spec, model)
    observed = Observation(SAME, done.drive, done.measured, spec)
    for axis in AXES:
        evidence = gathered(axis, model, observed)
        assert evidence.ratio(chain_of(model.axis(axis))).max() < AT_FLOOR
