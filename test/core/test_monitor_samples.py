"""Samples for viewers are those of the streams, however the blocks are cut."""

from itertools import pairwise
from math import isnan
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.streams import MONITOR_RATE, MonitorSample, MonitorSamples
from afm_scan_ros.core.types import Trace

PERIOD = 1e-3
STEP, TOTAL = 5, 31
DESIRED, ACHIEVED, DRIVE = "desired_displacement", "achieved_displacement", "drive_voltage"
NAMES = (DESIRED, ACHIEVED, DRIVE)

edges = st.sets(st.integers(1, TOTAL - 1)).map(lambda inner: [0, *sorted(inner), TOTAL])


def traces(values: np.ndarray, cut: list[int]) -> list[Trace]:
    return [Trace(a, PERIOD, values[0, a:b], values[1, a:b]) for a, b in pairwise(cut)]


@given(edges, edges, edges, st.randoms(use_true_random=False), st.integers(0, 99))
def test_the_samples_do_not_depend_on_blocks(
    first: list[int], second: list[int], third: list[int], order: Random, seed: int
) -> None:
    values = dict(zip(NAMES, np.random.default_rng(seed).normal(size=(3, 2, TOTAL)), strict=True))
    cuts = dict(zip(NAMES, (first, second, third), strict=True))
    queue = {name: traces(values[name], cuts[name]) for name in NAMES}
    samples, found = MonitorSamples(PERIOD), []
    while any(queue.values()):
        name = order.choice([n for n in NAMES if queue[n]])
        found += samples.add(name, queue[name].pop(0))
    assert [each.sample for each in found] == list(range(0, TOTAL, STEP))
    for each in found:
        (dx, dy), (ax, ay), (vx, vy) = (values[name][:, each.sample] for name in NAMES)
        assert (each.desired_x, each.desired_y) == (dx, dy)
        assert (each.achieved_x, each.achieved_y) == (ax, ay)
        assert (each.error_x, each.error_y) == (ax - dx, ay - dy)
        assert isnan(each.drive_x) or (each.drive_x, each.drive_y) == (vx, vy)


def at_once(*names: str) -> list[MonitorSample]:
    values = np.arange(2.0 * TOTAL).reshape(2, TOTAL)
    samples, found = MonitorSamples(PERIOD), []
    for name in names:
        found += samples.add(name, traces(values, [0, TOTAL])[0])
    return found


def test_a_drive_that_was_received_is_shown() -> None:
    assert [each.drive_x for each in at_once(DRIVE, DESIRED, ACHIEVED)] == list(range(0, 31, 5))


def test_a_recording_without_the_drive_is_shown_too() -> None:
    found = at_once(DESIRED, ACHIEVED)
    assert len(found) == 7
    assert all(isnan(each.drive_x) and isnan(each.drive_y) for each in found)


@pytest.mark.parametrize("rate", [50.0, 200.0, 300.0, 2e4, 100.1e3])
def test_there_are_as_many_as_the_rate_allows(rate: float) -> None:
    total = 1000
    x = np.zeros(total)
    samples = MonitorSamples(1.0 / rate)
    found = [
        each.sample
        for name in (DESIRED, ACHIEVED)
        for each in samples.add(name, Trace(0, 1.0 / rate, x, x))
    ]
    step = int(np.diff(found)[0])
    assert rate / step <= MONITOR_RATE * (1 + 1e-9)
    assert step == 1 or rate / (step - 1) > MONITOR_RATE
