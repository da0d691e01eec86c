"""The benches of learning count what they say they count."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_bench.learning.learning import LearningCase, error_percent, growths
from afm_scan_bench.learning.learning import measure as measure_learning
from afm_scan_bench.learning.learning_drawn import LARGEST, LearningCourse, near
from afm_scan_bench.learning.learning_effects import changing_percent
from afm_scan_bench.learning.learning_noise import mean_noise
from afm_scan_bench.learning.learning_speed import measure as measure_speed
from afm_scan_bench.learning.learning_transfer import others, transferred
from afm_scan_bench.learning.repeated import repeated
from afm_scan_bench.learning.rivals import eiic, learned, miic, p_type
from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_bench.scans import default_plant, spec_at
from afm_scan_ros.core.correction import window
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.simulation.axis import HysteresisSpec

SPEC = evolve(spec_at(100.0), preparation_cycles=2, lines=3)


def test_the_target_of_a_moved_resonance_is_met() -> None:
    (row,) = measure_learning([LearningCase(100.0, 5, 0.05)]).rows
    assert row["met"] == row["monotone"] == "yes"
    assert float(row["learned_percent"]) < 0.02 * float(row["first_percent"])


@given(st.integers(0, 99))
def test_a_drawn_scanner_is_near_and_another_each_time(seed: int) -> None:
    plant = default_plant()
    one, two = (near(plant, np.random.default_rng(seed)) for _ in range(2))
    assert one == two
    assert one != near(plant, np.random.default_rng(seed + 100))
    for name in ("gain", "density", "threshold_max", "decay"):
        assert abs(_of(one.x.hysteresis, name) / _of(plant.x.hysteresis, name) - 1.0) <= LARGEST


def _of(hysteresis: HysteresisSpec, name: str) -> float:
    return float(getattr(hysteresis, name))


def test_a_course_is_as_bad_as_its_worse_axis() -> None:
    course = LearningCourse(5.0, errors=((4.0, 2.0, 3.0), (1.0, 0.5, 2.0)), kept=1)
    assert course.over_first(course.kept) == 0.5
    assert course.over_first(-1) == 2.0
    assert course.growth == 1.5


def test_what_repeats_does_not_change_and_what_is_asynchronous_does() -> None:
    plants = (
        evolve(default_plant(), mechanisms=sized(each, "large", "x"))
        for each in ("delay", "periodic_disturbance_mains")
    )
    delay, mains = (repeated(SPEC, plant, 3) for plant in plants)
    assert changing_percent(delay) < 1e-9
    assert changing_percent(mains) > 0.5
    assert mean_noise(mains) > 2.0 * mean_noise(delay)


def test_growth_is_of_the_worst_axis() -> None:
    scans = repeated(SPEC, default_plant(), 3)
    assert growths(scans)[0] == (1.0, 0.0)
    assert error_percent(scans[0]) == error_percent(scans[1])


@pytest.mark.parametrize(
    ("law", "factor"),
    [(eiic(1.0, 1.0), 0.6), (miic(1.0), 0.9), (p_type(0.25), 1.0)],
)
def test_a_rival_improves_the_scans_that_suit_it(law: object, factor: float) -> None:
    slow = ScanSpec(lines=3, samples_per_line=2000, line_rate=5.0, preparation_cycles=2)
    loose = evolve(default_plant(), mechanisms=sized("backlash", "large", "x"))
    first, second = learned(slow, loose, law, 2, 1)  # type: ignore[arg-type]
    errors = [done.tracking("true").x.all for done in (first, second)]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[1].rms < factor * errors[0].rms


def test_a_correction_is_the_same_for_the_same_scan_and_follows_the_lines_of_others() -> None:
    correction = repeated(SPEC, default_plant(), 3)[-1].correction
    assert np.allclose(transferred(correction, SPEC, 1.0).x, correction.x * window(SPEC))
    where = phases(SPEC).lines
    for other in others(SPEC).values():
        there = phases(other).lines
        found = transferred(correction, other, 2.0).x[there.start : there.stop]
        assert np.allclose(found, 2.0 * correction.x[where.start : where.stop])


def test_the_step_is_timed_against_the_inversion() -> None:
    step, tested = measure_speed(SPEC, turns=1).rows
    assert float(tested["ours"]) == pytest.approx(float(step["ours"]) + float(step["theirs"]))
