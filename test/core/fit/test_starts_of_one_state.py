"""Records of one state: each begins where it does, and rest is where the operator depolarises."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.fit.alternatives import with_one_state
from afm_scan_ros.core.fit.candidates import rest_of
from afm_scan_ros.core.fit.descent import settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.types import Array
from helpers.fit_cases import GAIN, LIMIT, levels, of_bouc_wen, of_plays_alone, signals


def loops(theta: Array, drive: Array, start: float) -> Array:
    """W (V) of an operator under a drive."""
    operator = OneState(-LIMIT, LIMIT, (-1.0, 1.0))
    return operator.output(theta, drive, np.array([drive[0], start])) - drive


def fading() -> Array:
    """Slopes by which w tends to -0.5 V where the drive rises, and to 0.1 V where it falls."""
    operator = OneState(-LIMIT, LIMIT, (-1.0, 1.0))
    states = np.linspace(-1.0, 1.0, operator.shape[2])
    ways = np.array([-0.4 * (states + 0.5), 0.4 * (states - 0.1)])
    return (ways[:, np.newaxis] * np.ones(operator.shape)).ravel()


def test_rest_is_where_alternating_drives_of_falling_size_lead() -> None:
    operator, theta = OneState(-LIMIT, LIMIT, (-1.0, 1.0)), fading()
    (found,) = operator.depolarised(theta)
    phase = np.linspace(0.0, 1.0, 40_001)
    drive = LIMIT * (1.0 - phase) * np.cos(2.0 * np.pi * 40.0 * phase)
    assert -0.3 < found < -0.1
    for start in (-0.9, 0.9):
        assert abs(loops(theta, drive, start)[-1] - found) < 0.02


def test_records_of_one_state_have_memories_of_their_own_and_their_model_rests() -> None:
    """Whatever their drives do: only plays forget at both ends of a drive.

    The model's slopes are held where a path would leave their cells.
    """
    drives = [levels(seed, 8, 300) for seed in (1, 2)]
    layout, _, gain, theta = of_plays_alone(drives[0], drives[0])
    records = [
        evolve(signals(drive, GAIN * of_bouc_wen(drive), 1), rested=False, first=first)
        for drive, first in zip(drives, (0, 500), strict=True)
    ]
    fit = AxisFit(layout, records, gain, theta)
    fit.weigh()
    other = with_one_state(fit)
    assert [one.unknown for one in other.records] == [0, 1]
    assert [one.first for one in other.records] == [0, 500]  # as those of the plays, to compare
    memory = other.layout.parts["memory"]
    assert memory.stop - memory.start == 2 * OneState.unknowns
    model = model_of(other).hysteresis.operator()
    assert abs(model.apply(model.at_rest(), np.zeros(1))[1][0]) < 1e-9
    (rest,) = rest_of(other)
    moved = other.layout.operator.output(
        other.layout.of_operator(other.theta), drives[0], np.array([0.0, rest])
    )
    found = model.apply(model.at_rest(), drives[0])[1]
    np.testing.assert_allclose(found, moved - rest, atol=0.01 * LIMIT)


def test_creep_that_plays_need_leads_no_start_astray() -> None:
    """Plays that lack small fast loops take creep for them; one state has them without."""
    drive = levels(1, 6, 300)
    layout, records, gain, theta = of_plays_alone(drive, GAIN * of_bouc_wen(drive))
    started = []
    for creep in (0.0, 0.3):
        theta[layout.parts["creep"].start] = creep
        fit = AxisFit(layout, list(records), gain, theta.copy())
        fit.weigh()
        settle(fit, 3, layout.operator.parts)
        started.append(with_one_state(fit).discrepancy)
    assert started[1] < 1.2 * started[0]
