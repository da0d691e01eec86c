"""Halley's steps between bounds find the root of an increasing function, level or steep."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from afm_scan_ros.core.effects.viscous_plays import ROUNDS, first_try, halley, next_try

step = halley.py_func
following = next_try.py_func
first = first_try.py_func
BOUNDS = -4.0, 4.0
EXACT = 1e-12
slopes = st.one_of(st.just(0.0), st.floats(1e-3, 1e3))


@given(
    miss=st.floats(-10.0, 10.0, allow_subnormal=False).filter(bool),
    slope=st.floats(1e-3, 1e3),
    curvature=st.floats(-1e3, 1e3),
)
def test_a_step_goes_against_the_miss_by_two_thirds_to_twice_newtons(
    miss: float, slope: float, curvature: float
) -> None:
    share = step(miss, slope, curvature) / (-miss / slope)
    assert 2.0 / 3.0 - 1e-9 <= share <= 2.0 + 1e-9


@given(
    pieces=st.tuples(slopes, slopes, st.floats(1e-3, 1e3)),
    bend=st.floats(0.0, 10.0),
    kinks=st.tuples(st.floats(-4.0, 0.0), st.floats(0.0, 4.0)),
    root=st.floats(-4.0, 4.0),
    start=st.floats(-4.0, 4.0),
)
@example((4.0, 0.0, 1.0), 0.0, (0.0, 2.0), 1.0, 4.0)
def test_the_root_is_found_whatever_the_slopes(
    pieces: tuple[float, float, float],
    bend: float,
    kinks: tuple[float, float],
    root: float,
    start: float,
) -> None:
    """Of a curve that is straight below its first kink, then level, straight or bent."""

    def values(u: float) -> tuple[float, float, float]:
        first, second = max(u - kinks[0], 0.0), max(u - kinks[1], 0.0)
        height = pieces[2] * min(u, kinks[0]) + pieces[0] * (first - second)
        height += pieces[1] * second + bend * math.expm1(second)
        slope = pieces[2] if u < kinks[0] else pieces[0]
        if u < kinks[1]:
            return height, slope, 0.0
        return height, pieces[1] + bend * math.exp(second), bend * math.exp(second)

    wanted, (lower, upper), u = values(root)[0], BOUNDS, start
    scale = 1.0 + values(BOUNDS[1])[0] - values(BOUNDS[0])[0]
    for _ in range(ROUNDS):
        height, slope, curvature = values(u)
        miss = height - wanted
        if abs(miss) <= EXACT * scale:
            break
        lower, upper = (lower, u) if miss > 0.0 else (u, upper)
        u = following(u, step(miss, slope, curvature), (lower, upper), BOUNDS)
    assert abs(miss) <= EXACT * scale


@given(
    wanted=st.lists(st.floats(-4.0, 4.0, allow_subnormal=False), min_size=3, max_size=3),
    last=st.floats(-4.0, 4.0),
    u=st.floats(-4.0, 4.0),
)
def test_the_first_try_goes_on_within_the_bounds(
    wanted: list[float], last: float, u: float
) -> None:
    there = first(2, np.array(wanted), u, last, BOUNDS)
    assert BOUNDS[0] <= there <= BOUNDS[1]
    assert abs(there - u) <= 2.0 * abs(u - last) + 1e-15
    assert (there - u) * (u - last) >= 0.0


@given(start=st.floats(-1.0, 1.0), rise=st.floats(0.01, 0.3), growth=st.floats(0.1, 1.9))
def test_the_first_try_of_a_proportional_function_is_its_root(
    start: float, rise: float, growth: float
) -> None:
    roots = start + np.array([0.0, rise, rise + growth * rise])
    assert first(2, 3.0 * roots, roots[1], roots[0], BOUNDS) == pytest.approx(roots[2], abs=1e-9)
