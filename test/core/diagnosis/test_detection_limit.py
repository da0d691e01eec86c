"""What a good model leaves of a scan lies at the floor that is foretold of it."""

import pytest
from attrs import evolve

from afm_scan_ros.core.closed_loop.validation_scans import FIRST
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES
from helpers.in_process import InProcessSession, default_model, default_plant

SCAN = ScanSpec(line_rate=20.0, samples_per_line=500, lines=6, range_x=30e-6, range_y=30e-6)
SMOOTH = evolve(SCAN, pattern="lissajous")
CROSSING = evolve(SMOOTH, line_rate=5.0, samples_per_line=4000, lines=12, range_y=38e-6)
"""y crosses the levels of its table up to 450 times a second, where it resonates."""
FAST = evolve(SMOOTH, line_rate=100.0, lines=100, range_x=28e-6, range_y=28e-6)


@pytest.mark.parametrize("pattern", ["raster", "spiral"])
@pytest.mark.parametrize("lines", [6, 100])
def test_a_healthy_scanner_scans_at_its_floor_however_long(pattern: str, lines: int) -> None:
    assert _over_limit(evolve(SCAN, pattern=pattern, lines=lines)) < AT_LIMIT


@pytest.mark.parametrize("spec", [CROSSING, FAST])
def test_a_healthy_scanner_is_at_its_floor_where_it_resonates(spec: ScanSpec) -> None:
    assert _over_limit(spec) < AT_LIMIT


def _over_limit(spec: ScanSpec) -> float:
    """Return the largest rms of a band over its floor, on either axis."""
    model = default_model()
    done = InProcessSession(default_plant(), 3).scan(FIRST, spec, model)
    observed = Observation(FIRST, done.drive, done.measured, spec)
    evidence = {axis: evidence_of(axis, model, observed) for axis in AXES}
    return max(float(e.ratio(chain_of(model.axis(a))).max()) for a, e in evidence.items())
