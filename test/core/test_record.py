"""Laws of a record: its parts, its axes, and what it is equal to."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as s

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.record import Record

COUNT = 50
DRIVE = np.random.default_rng(1).standard_normal((COUNT, 2))
RECORD = Record(DRIVE, 5e-6 * DRIVE, 1e-3, ("x", "y"), start="depolarised", name="noise")


@given(first=s.integers(-2, COUNT + 2), last=s.integers(-2, COUNT + 2))
def test_a_part_holds_the_samples_asked_for_or_is_refused(first: int, last: int) -> None:
    if 0 <= first < last <= COUNT:
        part = RECORD.part(first, last)
        np.testing.assert_array_equal(part.drive, DRIVE[first:last])
        assert part.depolarised == (first == 0)
    else:
        with pytest.raises(InputError, match=f"noise: has no samples from {first} to before"):
            RECORD.part(first, last)


@given(cut=s.integers(1, COUNT - 1), axis=s.sampled_from("xy"))
def test_the_part_of_an_axis_is_the_axis_of_the_part(cut: int, axis: str) -> None:
    assert RECORD.part(0, cut).axis(axis) == RECORD.axis(axis).part(0, cut)
    assert RECORD.axis(axis) != RECORD.axis(axis).part(0, cut)


def test_equality_is_by_value() -> None:
    again = evolve(RECORD, drive=DRIVE.copy())
    assert again == RECORD
    assert hash(again) == hash(RECORD)
    assert evolve(RECORD, drive=np.nextafter(DRIVE, 1.0)) != RECORD


def test_an_axis_that_is_not_held_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="noise: has no axis z: give one of x, y"):
        RECORD.axis("z")
