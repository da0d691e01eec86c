"""The whole scanner: one path for one seed, however it is cut, and nothing out of order."""

from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec, SensorSpec

PERIOD = 5e-5
TIME = np.arange(400) * PERIOD
X, Y = 3.0 * np.sin(700.0 * TIME), 2.0 * np.sin(40.0 * TIME)


def block(first: int, last: int, x: Array = X, y: Array = Y) -> Trace:
    return Trace(first, PERIOD, x[first:last], y[first:last])


@settings(deadline=None, max_examples=30)
@given(cuts=st.sets(st.integers(1, X.size - 1), max_size=8), seed=st.integers(0, 2**32))
def test_cutting_into_blocks_changes_nothing(plant: PlantSpec, cuts: set[int], seed: int) -> None:
    expected = Piezoscanner(plant, PERIOD, seed).advance(block(0, X.size))
    scanner = Piezoscanner(plant, PERIOD, seed)
    edges = [0, *sorted(cuts), X.size]
    parts = [scanner.advance(block(a, b)) for a, b in pairwise(edges)]
    for found, whole in zip(zip(*parts, strict=True), expected, strict=True):
        for axis in "xy":
            joined = np.concatenate([part.axis(axis) for part in found])
            np.testing.assert_array_equal(joined, whole.axis(axis))


def test_the_seed_changes_the_reading_and_not_the_truth(plant: PlantSpec) -> None:
    one, same = (Piezoscanner(plant, PERIOD, seed).advance(block(0, 400)) for seed in (1, 2))
    np.testing.assert_array_equal(one[1].x, same[1].x)
    assert np.any(one[0].x != same[0].x)


def test_axes_do_not_move_each_other(plant: PlantSpec) -> None:
    both = Piezoscanner(plant, PERIOD, 0).advance(block(0, 400))[1]
    alone = Piezoscanner(plant, PERIOD, 0).advance(block(0, 400, y=np.zeros(400)))[1]
    np.testing.assert_array_equal(alone.x, both.x)
    assert not alone.y.any()


def test_a_sample_answers_only_earlier_drive(plant: PlantSpec) -> None:
    changed = X.copy()
    changed[200] += 1.0
    first = Piezoscanner(plant, PERIOD, 0).advance(block(0, 400))[1].x
    second = Piezoscanner(plant, PERIOD, 0).advance(block(0, 400, x=changed))[1].x
    np.testing.assert_array_equal(second[:201], first[:201])
    assert second[201] != first[201]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (block(11, 20), "begins at sample 11, expected 10"),
        (block(0, 10), "begins at sample 0, expected 10"),
        (Trace(10, 2 * PERIOD, X[:5], Y[:5]), "sample period 0.0001 s, the scanner 5e-05 s"),
        (Trace(10, PERIOD, X[:5], Y[:4]), r"shapes \(5,\) in x and \(4,\) in y"),
        (Trace(10, PERIOD, X[:0], Y[:0]), r"shapes \(0,\) in x"),
    ],
)
def test_a_misplaced_block_is_refused(plant: PlantSpec, wrong: Trace, message: str) -> None:
    scanner = Piezoscanner(plant, PERIOD, 0)
    scanner.advance(block(0, 10))
    with pytest.raises(InputError, match=message):
        scanner.advance(wrong)


@pytest.mark.parametrize("period", [0.0, -1e-5, float("nan"), float("inf")])
def test_a_sample_period_must_be_positive(plant: PlantSpec, period: float) -> None:
    with pytest.raises(InputError, match="sample_period"):
        Piezoscanner(plant, period, 0)


def test_a_refused_block_leaves_the_scanner_where_it_was(plant: PlantSpec) -> None:
    scanner = Piezoscanner(plant, PERIOD, 0)
    scanner.advance(block(0, 100))
    too_much = Trace(100, PERIOD, np.array([X[99], 5.1]), np.zeros(2))
    with pytest.raises(ScanError, match="sample 101, axis x: drive"):
        scanner.advance(too_much)
    narrow = Piezoscanner(evolve(plant, sensor=SensorSpec(0.0, 1e-6, 16)), PERIOD, 0)
    with pytest.raises(ScanError, match="axis x: displacement"):
        narrow.advance(block(0, 100))
    assert (scanner.next_sample, narrow.next_sample) == (100, 0)
    undisturbed = Piezoscanner(plant, PERIOD, 0)
    undisturbed.advance(block(0, 100))
    found, expected = (each.advance(block(100, 200))[0].x for each in (scanner, undisturbed))
    np.testing.assert_array_equal(found, expected)


def test_the_ramp_down_follows_the_last_drive(plant: PlantSpec) -> None:
    scanner = Piezoscanner(plant, PERIOD, 0)
    scanner.advance(block(0, 100))
    ramp = scanner.ramp_down()
    assert ramp.x[0] == pytest.approx(X[99], rel=1e-3)
    scanner.advance(ramp)
    assert scanner.next_sample == 100 + ramp.x.size
    assert not scanner.ramp_down().x.any()
