"""Adaptation keeps the error of a scanner whose resonance drifts, and leaves one that does not."""

import numpy as np
from attrs import evolve

from afm_scan_bench.learning.adaptation import BLOCK, tracked
from afm_scan_bench.scans import spec_at

SPEC = evolve(spec_at(100.0), lines=240, preparation="none")
MEMORY = 0.1
LAST = slice(200, None)
LAG = 0.03 / SPEC.lines * (100.0 * MEMORY + 2 * BLOCK)
"""Of the frequency's factor: it drifts on during the memory and the delay."""


def test_a_drifting_resonance_is_followed() -> None:
    without, with_it = (tracked(SPEC, 0.03, adapt=each, memory=MEMORY) for each in (False, True))
    assert np.all(with_it.error[LAST] < 0.25 * without.error[LAST])
    assert 1.03 - 1.2 * LAG < with_it.frequency[-1] < 1.03


def test_a_scanner_that_does_not_change_is_left() -> None:
    without, with_it = (tracked(SPEC, 0.0, adapt=each, memory=MEMORY) for each in (False, True))
    np.testing.assert_allclose(with_it.error, without.error, rtol=1e-9)
    assert np.all(with_it.frequency == 1.0)
