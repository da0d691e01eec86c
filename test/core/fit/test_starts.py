"""Records that began at depolarised rest although nobody states it."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.candidates import begun_at_rest
from afm_scan_ros.core.fit.estimator import AxisFit
from helpers.fit_cases import GAIN, displaced, levels, of_plays, of_plays_alone, record


def three_unknown_starts() -> AxisFit:
    drive = levels(1, 14, 300)
    layout, (one,), gain, _ = of_plays_alone(drive, GAIN * drive)
    layout = evolve(layout, unknown_starts=3)
    records = [evolve(one, rested=False, unknown=k, first=100) for k in range(3)]
    theta = layout.start()
    theta[layout.parts["memory"]] = np.arange(3.0 * layout.operator.unknowns)
    return AxisFit(layout, records, gain, theta)


def test_the_others_keep_what_they_remember() -> None:
    fit = three_unknown_starts()
    found = begun_at_rest(fit, [1])
    assert [one.rested for one in found.records] == [False, True, False]
    assert found.layout.size == fit.layout.size - fit.layout.operator.unknowns
    for k in (0, 2):
        before, _ = fit.layout.start_of(fit.theta, fit.records[k])
        after, _ = found.layout.start_of(found.theta, found.records[k])
        np.testing.assert_array_equal(after, before)
    rested, _ = found.layout.start_of(found.theta, found.records[1])
    np.testing.assert_array_equal(rested, found.layout.at_rest(found.theta)[0])


def test_a_record_counts_from_rest_on() -> None:
    found = begun_at_rest(three_unknown_starts(), [0, 2])
    assert [one.first for one in found.records] == [0, 100, 0]


@pytest.mark.parametrize("rested", [True, False])
def test_a_first_step_from_rest_is_told_from_a_start_in_use(*, rested: bool) -> None:
    """A scanner at rest rings and creeps after the first sample, one in use had settled there."""
    drive = levels(2, 14, 400)[600:]
    assert abs(drive[0]) > 0.5
    moved = record(of_plays, drive)
    if not rested:
        used = np.concatenate([levels(4, 14, 600), np.full(20_000, drive[0])])
        whole = displaced(of_plays, np.concatenate([used, drive]))
        moved = evolve(moved, displacement=whole[len(used) :, np.newaxis])
    fit = fit_axis([evolve(moved, start="unknown")], moved.axes[0])
    assert fit.records[0].rested == rested


@pytest.mark.parametrize("rested", [True, False])
def test_moves_to_both_ends_tell_whether_a_scanner_rested_before(*, rested: bool) -> None:
    """The memory is known from the second end on; the way there shows a swing of 0.1 V before."""
    ends = np.interp(np.arange(1400), [0, 350, 1050, 1400], [0.0, 3.6, -3.6, 0.0])
    drive = np.concatenate([ends, levels(2, 60, 400)])
    moved = record(of_plays, drive)
    if not rested:
        used = np.concatenate(
            [np.interp(np.arange(600), [0, 300, 600], [0.0, 0.1, 0.0]), np.zeros(20_000)]
        )
        remanence = displaced(of_plays, np.concatenate([used, drive]))[len(used) :]
        remanence -= displaced(of_plays, drive)
        moved = evolve(moved, displacement=moved.displacement + remanence[:, np.newaxis])
    fit = fit_axis([evolve(moved, start="unknown")], moved.axes[0])
    assert fit.records[0].rested == rested
    assert (fit.records[0].first == 0) == rested


def test_a_map_before_the_plays_moves_where_they_rest() -> None:
    """That of these scanners is u + 0.01 u² and a cube: swings of u are about -0.01 u²."""
    fit = fit_axis([record(of_plays, levels(1, 14, 600))], "x")
    bias, _ = fit.layout.operator.bias(fit.theta[fit.layout.parts["rest"]])
    expected = -0.01 * fit.layout.operator.half**2
    assert bias == pytest.approx(expected, rel=0.4)
