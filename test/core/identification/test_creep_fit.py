"""Creep is recovered from records that scipy integrated, and doubted where it must be."""

from functools import cache

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep.fit import CreepFit, fit_creep
from afm_scan_ros.core.identification.creep.series import _Profile, spring
from afm_scan_ros.core.identification.drives.excitation import creep_plan, excitation_block
from afm_scan_ros.core.identification.findings import (
    CreepBeyondNoise,
    ShortHold,
    SlowStep,
    UndeterminedCreepElement,
)
from afm_scan_ros.core.types import Array

PAPER = {
    "Eq. 6": ([1.0, 0.630, 0.0216, 6.25e-5], [1.0, 0.516, 0.0171, 4.69e-5]),
    "Eq. 9": ([1.0, 0.589, 0.0233, 1.48e-5], [1.0, 0.517, 0.0197, 1.14e-5]),
}
NOISE = 2e-9
FIVE_MINUTES, CALIBRATION = (300.0,), (3000.0, 600.0)


def truth(equation: str) -> dict[str, float]:
    residues, poles, _ = signal.residue(*PAPER[equation])
    order = np.argsort(-1.0 / poles.real)
    gains, constants = (-residues / poles).real[order], (-1.0 / poles.real)[order]
    named = {f"gain_{i + 1}": gain for i, gain in enumerate(gains)}
    return named | {f"time_constant_{i + 1}": tau for i, tau in enumerate(constants)}


def record(equation: str, holds: tuple[float, ...]) -> tuple[Array, Array, float]:
    plan = creep_plan(holds)
    drive = excitation_block(plan, 0, plan.total_samples).x
    # The hysteresis scales each step by a factor of its own, which must not matter.
    effective = np.where(drive > 0.5, 0.5 + 1.3 * (drive - 0.5), drive)
    sampled = signal.cont2discrete(PAPER[equation], plan.sample_period)
    moved = signal.lfilter(sampled[0][0], sampled[1], 3e-6 * effective)
    noise = NOISE * np.random.default_rng(5).standard_normal(len(drive))
    return drive, moved + noise, plan.sample_period


@cache
def fit(equation: str, holds: tuple[float, ...]) -> CreepFit:
    return fit_creep(*record(equation, holds))


@pytest.mark.parametrize("equation", PAPER)
def test_calibration_identifies_order_gains_and_time_constants(equation: str) -> None:
    found, true = fit(equation, CALIBRATION), truth(equation)
    assert found.order == 3
    assert found.warnings == ()
    for name, (low, high) in found.intervals.items():
        assert high - low < 0.02 * true[name]
        assert low - 0.01 * true[name] < true[name] < high + 0.01 * true[name]
    assert found.fitted.sigma == pytest.approx(NOISE, rel=0.01)


@pytest.mark.parametrize("equation", PAPER)
@pytest.mark.parametrize("holds", [FIVE_MINUTES, CALIBRATION])
def test_chosen_order_predicts_what_it_has_not_seen_to_the_noise(
    equation: str, holds: tuple[float, ...]
) -> None:
    found = fit(equation, holds)
    assert found.noise == pytest.approx(NOISE, rel=0.02)
    assert found.held_out.sigma <= 1.1 * found.noise
    smaller = [tried for tried in found.orders if tried.order < found.order]
    assert min(tried.held_out.sigma for tried in smaller) > 1.1 * found.noise


def test_five_minutes_do_not_determine_the_slowest_element() -> None:
    found = fit("Eq. 9", FIVE_MINUTES)
    low, high = found.intervals["gain_3"]
    assert 0.1 < (high - low) / 2.0 / found.model.gains[2] < 0.4
    element, short = found.warnings
    assert isinstance(element, UndeterminedCreepElement)
    assert (element.element, element.hold) == (3, pytest.approx(300.0, rel=0.01))
    assert element.gain_interval == found.intervals["gain_3"]
    assert isinstance(short, ShortHold)
    assert short.slowest == pytest.approx(100.0, rel=0.01)
    assert fit("Eq. 6", FIVE_MINUTES).warnings == (short,)


def test_a_minute_merges_elements_and_is_found_short() -> None:
    found = fit("Eq. 9", (60.0, 20.0))
    assert found.order < 3
    (short,) = [each for each in found.warnings if isinstance(each, ShortHold)]
    assert short.needed == 1800.0


def test_a_record_that_creeps_as_nothing_does_is_refused() -> None:
    drive, displacement, period = record("Eq. 6", FIVE_MINUTES)
    runaway = displacement + 1e-8 * np.arange(len(drive)) * period
    with pytest.raises(InputError, match="more than creep can be"):
        fit_creep(drive, runaway, period, highest=2)
    shaken = displacement + 1e-6 * np.sin(20.0 * np.arange(len(drive)) * period)
    with pytest.raises(InputError, match="creep record: the residual of the creep model is"):
        fit_creep(drive, shaken, period, highest=2)


def test_record_without_holds_is_refused() -> None:
    drive = np.linspace(0.0, 1.0, 5000)
    with pytest.raises(InputError, match="holds still 0 times"):
        fit_creep(drive, drive, 0.01)


def test_hold_too_short_for_any_element_is_refused() -> None:
    drive = np.repeat([0.0, 0.5], [500, 900])
    with pytest.raises(InputError, match="held for 9 s, 900 samples; hold it for 10 s"):
        fit_creep(drive, drive, 0.01)


def test_an_open_interval_is_found() -> None:
    found = fit("Eq. 9", (120.0,))
    assert np.isinf(found.intervals["time_constant_3"][1])
    assert np.isinf(found.intervals["gain_3"][1])
    unbounded = [each for each in found.warnings if isinstance(each, UndeterminedCreepElement)]
    assert any(np.isinf(each.time_constant_interval[1]) for each in unbounded)


def test_slow_step_and_drift_are_found() -> None:
    drive, displacement, period = record("Eq. 6", FIVE_MINUTES)
    drifting = displacement + 1e-7 * np.sin(np.arange(len(drive)) * period / 20.0)
    slow = drive.copy()
    slow[491:501] = np.linspace(0.05, 0.5, 10)
    found = fit_creep(slow, drifting, period, highest=3).warnings
    (drift,) = [each for each in found if isinstance(each, CreepBeyondNoise)]
    assert drift.sigma > 1.1 * drift.noise
    (step,) = [each for each in found if isinstance(each, SlowStep)]
    assert step.duration == pytest.approx(0.09)


def test_move_that_comes_back_to_its_level_is_refused() -> None:
    drive = np.zeros(5000)
    drive[2000:2010] = 1.0
    with pytest.raises(InputError, match="back at 0 V by sample 2010"):
        fit_creep(drive, drive, 0.01)


class Wandering(_Profile):
    """A fit that ends at less and less error, wherever it is asked for."""

    def __init__(self) -> None:
        self._best = self._last = spring()
        self._asked = 0

    def _growth(self, logarithm: float) -> float:
        self._asked += 1
        return abs(logarithm) - 0.0065 - 0.004 * self._asked


def test_an_interval_ends_although_fits_depend_on_where_they_begin() -> None:
    assert 0.01 < np.log(Wandering().end(1.0, 1.0)) < 0.1
