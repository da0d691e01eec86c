"""The detection limit of a record that began unprepared."""

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.discrepancy import FIRST_CYCLES, UNPREPARED_FACTOR, DetectionLimit


def test_a_rest_that_the_first_move_takes_away_lies_in_a_records_first_cycles() -> None:
    edges = (0.0, 1.0, 3.0, 10.0)
    limit = DetectionLimit(edges, np.ones(3), np.zeros(3), 450.0)
    assert limit.unprepared(0.9 * FIRST_CYCLES).rms == pytest.approx(
        [UNPREPARED_FACTOR, UNPREPARED_FACTOR, 1.0]
    )
    assert limit.unprepared(1.1 * FIRST_CYCLES).rms == pytest.approx([UNPREPARED_FACTOR, 1.0, 1.0])
