"""An effect that the record does not distinguish from a simpler one does not compete."""

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.candidates import Candidate, FittedCandidates
from afm_scan_ros.core.diagnosis.discrepancy import FIRST_CYCLES, UNPREPARED_FACTOR, DetectionLimit
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.scoring import reduces_to_simpler
from afm_scan_ros.core.effects.registry import effect_type

TOLD = np.array([1e-3, 50.0, 5e-3])
"""Half the intervals of share, frequency (Hz) and damping of a mode that its record shows."""


def candidate(name: str, kind: str = "") -> Candidate:
    return Candidate(effect_type(name), effect_type(name).form(kind))


def mode(halfwidth: np.ndarray, frequency: float = 900.0) -> FittedCandidates:
    values = np.array([[-0.01, frequency, 0.02]])
    return FittedCandidates(
        (candidate("extra_resonance", "parallel"),), Fit(values, halfwidth, 1.0), 1.0
    )


@pytest.mark.parametrize("unknown", [1, 2])
def test_a_mode_that_no_drive_reaches_is_a_gain(unknown: int) -> None:
    open_end = TOLD.copy()
    open_end[unknown] = np.inf
    assert reduces_to_simpler(mode(open_end), candidate("parameter_shift", "gain"))
    assert not reduces_to_simpler(mode(open_end), candidate("delay"))


def test_a_mode_that_the_record_tells_is_no_gain() -> None:
    assert not reduces_to_simpler(mode(TOLD), candidate("parameter_shift", "gain"))


def test_an_effect_that_may_be_zero_does_not_compete_with_a_simpler_one() -> None:
    faint = np.array([0.02, *TOLD[1:]])
    assert reduces_to_simpler(mode(faint), candidate("delay"))


def test_a_competing_model_at_the_edge_of_its_range_is_a_limit() -> None:
    assert reduces_to_simpler(mode(TOLD, frequency=3000.0), candidate("delay"))


def test_a_rest_that_the_first_move_takes_away_lies_in_a_records_first_cycles() -> None:
    edges = (0.0, 1.0, 3.0, 10.0)
    limit = DetectionLimit(edges, np.ones(3), np.zeros(3))
    assert limit.unprepared(0.9 * FIRST_CYCLES).rms == pytest.approx(
        [UNPREPARED_FACTOR, UNPREPARED_FACTOR, 1.0]
    )
    assert limit.unprepared(1.1 * FIRST_CYCLES).rms == pytest.approx([UNPREPARED_FACTOR, 1.0, 1.0])
