"""Real records of a micromanipulator: transient, held-out prediction, and our inverse."""

import pytest

from afm_scan_bench.measured.micromanipulator.study import (
    FALLING,
    JUDGED,
    MICRO,
    SAMPLE_RATE,
    STEADY,
    SWITCHING,
    WITH_INVERSE,
    Study,
)
from afm_scan_bench.measured.recordings import VARIABLE
from afm_scan_ros.core.errors import InputError


@pytest.fixture(scope="module")
def study() -> Study:
    try:
        return Study()
    except InputError as error:
        pytest.skip(f"{VARIABLE}: {error}")


def test_segments_follow_each_other_and_no_held_out_one_is_fitted() -> None:
    assert STEADY.end == FALLING.start
    assert FALLING.end <= min(segment.start for segment in JUDGED)
    judged = sorted([*JUDGED, SWITCHING], key=lambda segment: segment.start)
    assert [segment.end for segment in judged[:-1]] == [segment.start for segment in judged[1:]]


def test_held_out_segments_are_predicted(study: Study) -> None:
    for segment in (*JUDGED, WITH_INVERSE):
        error = (study.predicted - study.measured)[segment.samples]
        assert error.std() < 0.3 * MICRO, segment


def test_our_inverse_would_leave_less_than_theirs(study: Study) -> None:
    theirs = (study.measured - study.desired)[WITH_INVERSE.samples].std()
    ours = (study.predicted_with_ours - study.desired)[WITH_INVERSE.samples].std()
    assert theirs == pytest.approx(0.6 * MICRO, abs=0.05 * MICRO)
    assert ours < 0.3 * MICRO


def test_our_inverse_asks_for_nearly_the_drive_that_was(study: Study) -> None:
    start = round(FALLING.end * SAMPLE_RATE)
    assert (study.inverted - study.drive)[start:].std() < 0.02  # V, of 3.3
