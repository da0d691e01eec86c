"""Laws of finding reversal curves in a drive."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import GROWTH, graded, hysteresis_plan
from afm_scan_ros.core.identification.drives.waveforms import whole
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurve,
    ReversalCurves,
    reversal_curves,
    turning_points,
)
from afm_scan_ros.core.types import Array

LIMIT, LEVELS = 2.0, 21
PLAN = hysteresis_plan(LIMIT, LEVELS)
DRIVE = whole(PLAN.x)[::10].copy()
CURVES = reversal_curves(DRIVE)


def path(*corners: float) -> Array:
    pieces = [np.linspace(a, b, 40)[1:] for a, b in pairwise(corners)]
    return np.concatenate([[corners[0]], *pieces])


def test_both_families_turn_at_every_level() -> None:
    levels = graded(LIMIT, LEVELS)
    falling, rising = (DRIVE[spans[:, 0]] for spans in (CURVES.falling, CURVES.rising))
    np.testing.assert_allclose(falling, levels[1:], atol=1e-3)
    np.testing.assert_allclose(np.unique(rising.round(3)), levels[:-1], atol=2e-3)
    assert DRIVE[CURVES.end] == pytest.approx(-LIMIT, abs=1e-3)


@given(st.integers(3, 200))
def test_levels_are_densest_in_the_middle_and_no_distance_is_much_wider_than_the_next(
    count: int,
) -> None:
    levels = graded(LIMIT, count)
    distances = np.diff(levels)
    np.testing.assert_allclose(levels, -levels[::-1], atol=1e-12)
    assert np.all(np.diff(distances[(count - 1) // 2 :]) >= -1e-12)
    ratio = distances[1:] / distances[:-1]
    assert max(ratio.max(initial=1.0), 1.0 / ratio.min(initial=1.0)) < (1.0 + GROWTH) * 1.01


def test_curves_run_from_turn_to_saturation_in_one_direction() -> None:
    for curve in CURVES.of(DRIVE, DRIVE):
        saturation = LIMIT if curve.rises else -LIMIT
        assert curve.inputs[-1] == pytest.approx(saturation, abs=1e-3)
        moves = np.diff(curve.inputs)
        assert np.all(moves >= 0.0 if curve.rises else moves <= 0.0)


def test_saturations_are_the_ends_of_the_curves() -> None:
    low, high = CURVES.saturations(DRIVE)
    np.testing.assert_allclose(low, -LIMIT, atol=1e-3)
    np.testing.assert_allclose(high, LIMIT, atol=1e-3)


def test_turning_points_are_those_of_the_plan() -> None:
    levels = PLAN.x.levels[2:-2]
    np.testing.assert_allclose(DRIVE[turning_points(DRIVE)], levels, rtol=0.0, atol=1e-3)


@settings(max_examples=30, deadline=None)
@given(pitch=st.floats(0.01, 1.0), sign=st.sampled_from([-1.0, 1.0]))
def test_thinning_keeps_the_turn_and_a_straight_curve_straight(pitch: float, sign: float) -> None:
    inputs = sign * np.linspace(-1.0, 1.0, 301)
    thin = ReversalCurve(inputs, 3.0 * inputs + 1.0).thinned(lambda at: at / pitch)
    assert thin.turn == inputs[0]
    assert thin.rises == (sign > 0.0)
    assert len(thin.inputs) <= 2.0 / pitch + 1.0
    np.testing.assert_allclose(thin.outputs, 3.0 * thin.inputs + 1.0, atol=1e-12)


def test_one_family_serves() -> None:
    curves = reversal_curves(path(0.0, -1.0, 1.0, -1.0, 0.5, -1.0, 0.0, -1.0, -0.5, -1.0, 0.0))
    assert (len(curves.falling), len(curves.rising)) == (4, 0)


def refuses(drive: Array, words: str) -> None:
    with pytest.raises(InputError, match=words):
        reversal_curves(drive)


def test_record_without_curves_is_refused() -> None:
    refuses(np.linspace(0.0, 1.0, 50), "no curve leaves saturation and returns")


def test_missing_curves_are_refused_by_the_levels_beside_them() -> None:
    levels = np.linspace(-1.0, 1.0, 21)
    gap = path(-1.0, *np.column_stack([np.delete(levels[1:], [7, 8]), -np.ones(18)]).ravel())
    refuses(gap, "no curve turns between -0.3 V and 0 V")


@pytest.mark.parametrize("first", range(5))
def test_every_fifth_curve_may_be_left_out(first: int) -> None:
    levels = np.append(np.delete(np.linspace(-0.9, 0.9, 19), slice(first, None, 5)), 1.0)
    drive = path(-1.0, *np.column_stack([levels, -np.ones(len(levels))]).ravel())
    assert len(reversal_curves(drive).falling) == len(levels)


def test_family_that_stops_short_of_the_other_saturation_is_refused() -> None:
    short = path(-1.0, 0.5, -1.0, 0.0, -1.0, -0.5, -1.0, 1.0, 0.9, 0.95)
    refuses(short, "no curve turns between 0.5 V and 1 V")


def test_end_of_a_record_without_a_tail_is_its_end() -> None:
    curves: ReversalCurves = reversal_curves(path(0.0, 1.0, -1.0, 1.0, 0.0, 1.0, 0.5, 1.0, 0.9))
    assert curves.end == 8 * 39 + 1


def test_a_record_may_begin_and_end_at_the_saturation_that_its_curves_leave() -> None:
    drive = path(2.0, 1.0, 2.0, 0.0, 2.0, -1.0, 2.0)
    curves = reversal_curves(drive)
    np.testing.assert_allclose(drive[curves.rising], [[-1.0, 2.0], [0.0, 2.0], [1.0, 2.0]])
    assert (len(curves.falling), curves.end) == (0, len(drive))


def test_the_first_rise_of_a_depolarised_scanner_is_no_reversal_curve() -> None:
    """Of a drive from 0 V on, rest is an end of the range but not saturation."""
    corners = [c for level in np.linspace(10.0, 1.0, 10) for c in (level, 0.0)]
    first, *_ = turning_points(fresh := path(0.0, 5.0, 0.0, *corners))
    assert first not in reversal_curves(fresh).falling[:, 0]
    later = path(10.0, 0.0, 5.0, 0.0, *corners)
    _, turn, *_ = turning_points(later)
    assert turn in reversal_curves(later).falling[:, 0]
