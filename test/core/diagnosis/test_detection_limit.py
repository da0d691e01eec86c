"""What a good model leaves of a scan lies at the floor that is foretold of it."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import sawtooth

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.closed_loop import FIRST
from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.settings import LIMIT
from afm_scan_ros.core.model import ModelDiscrepancy, band_edges
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array
from helpers.in_process import InProcessSession, default_model, default_plant

WIDE = ScanSpec(preparation_lower=-28e-6, preparation_upper=25e-6)
"""A preparation that sets what the model's own rest is wrong about."""
SCAN = evolve(WIDE, line_rate=20.0, samples_per_line=500, lines=6, range_x=30e-6, range_y=30e-6)
SMOOTH = evolve(SCAN, pattern="lissajous")
CROSSING = evolve(SMOOTH, line_rate=5.0, samples_per_line=4000, lines=12, range_y=38e-6)
"""y crosses the levels of its table up to 450 times a second, where it resonates."""
FAST = evolve(SMOOTH, line_rate=100.0, lines=100, range_x=28e-6, range_y=28e-6)


@pytest.mark.parametrize("pattern", ["raster", "spiral"])
@pytest.mark.parametrize("lines", [6, 100])
def test_a_healthy_scanner_scans_at_its_floor_however_long(pattern: str, lines: int) -> None:
    assert _over_limit(evolve(SCAN, pattern=pattern, lines=lines)) < LIMIT.expected


@pytest.mark.parametrize("spec", [CROSSING, FAST])
def test_a_healthy_scanner_is_at_its_floor_where_it_resonates(spec: ScanSpec) -> None:
    assert _over_limit(spec) < LIMIT.expected


def _over_limit(spec: ScanSpec) -> float:
    """Return the largest rms of a band over its floor, on either axis."""
    model = default_model()
    done = InProcessSession(default_plant(), 3).scan(FIRST, spec, model)
    observed = Record.of_traces(FIRST, done.drive, done.measured, spec)
    evidence = {axis: evidence_of(axis, model, observed) for axis in AXES}
    return max(float(e.ratio(chain_of(model.axis(a))).max()) for a, e in evidence.items())


PERIOD = 5e-4
MOVED = 1e-5 * np.asarray(sawtooth(4.0 * np.pi * PERIOD * np.arange(20_000), 0.5))


def known_of(moved: Array, share: float) -> ModelDiscrepancy:
    """Record of a motion of which a share is missed in every band."""
    bands = band_edges(PERIOD, 450.0)
    size = rms_by_band(moved, bands, PERIOD)
    return ModelDiscrepancy("one", bands, share * size, 0.0 * size, size)


@given(share=st.floats(0.01, 0.5))
def test_a_record_counts_however_much_of_its_motion_is_missed(share: float) -> None:
    """Of motion between two records, the limit lies between their relative errors."""
    known = [known_of(2.0 * MOVED, 0.01), known_of(0.5 * MOVED, share)]
    found = detection_limit(known, MOVED, PERIOD, 450.0).total / float(np.std(MOVED))
    assert 0.01 * 0.99 <= found <= share * 1.6
    assert found >= 0.3 * share
