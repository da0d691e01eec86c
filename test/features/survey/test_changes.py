"""One change point in a series, rarely where there is none; and which instruments changed."""

import numpy as np
import pytest
import scipy
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.features.survey.changes import (
    ChangePoint,
    EstimateSeries,
    change_point,
    changes,
    usable,
)
from afm_scan_ros.features.survey.recording import (
    NamedEffect,
    QuantityEstimate,
    Recording,
    SurveyedAxis,
)

NOISE, ERROR = 1e-4, 1e-2
SEEDS = st.integers(0, 2**31)


def series(
    values: np.ndarray, motions: list[int] | None = None, error: float = ERROR
) -> EstimateSeries:
    count = len(values)
    return EstimateSeries(
        values, np.full(count, NOISE), np.full(count, error), motions or [0] * count
    )


def scattered(seed: int, count: int, scatter: float = 1.0) -> np.ndarray:
    return scatter * NOISE * np.random.default_rng(seed).standard_normal(count)


def found(of: EstimateSeries) -> ChangePoint:
    point = change_point(of)
    assert point is not None
    return point


@given(SEEDS, st.integers(4, 30), st.floats(2.0, 5.0))
def test_for_one_motion_it_is_students_test_at_the_likeliest_place(
    seed: int, count: int, scatter: float
) -> None:
    values = scattered(seed, count, scatter)
    tails = []
    for place in range(1, count):
        test = scipy.stats.ttest_ind(values[:place], values[place:])
        spread = values - np.where(
            np.arange(count) < place, values[:place].mean(), values[place:].mean()
        )
        if np.sum(spread**2) > (count - 2) * NOISE**2:  # else the noise that is known counts
            tails.append(test.pvalue)
    point = found(series(values, error=np.inf))
    if len(tails) == count - 1:
        assert point.probability == pytest.approx(min(1.0, 2 * (count - 1) * min(tails)))


@pytest.mark.parametrize("scatter", [1.0, 10.0])
@pytest.mark.parametrize("motions", [1, 2, 5])
def test_a_false_change_is_as_rare_as_stated(scatter: float, motions: int) -> None:
    rng = np.random.default_rng(7)
    falsely = 0
    for seed in range(500):
        kinds = rng.integers(0, motions, 20)
        values = scattered(seed, 20, scatter) + ERROR * rng.standard_normal(motions)[kinds]
        falsely += found(series(values, kinds.tolist())).probability <= 0.05
    assert falsely <= scipy.stats.binom.ppf(0.999, 500, 0.05)


@given(SEEDS, st.integers(3, 17), st.sampled_from([-1.0, 1.0]))
def test_a_large_step_is_found_in_its_place(seed: int, place: int, sign: float) -> None:
    values = scattered(seed, 20)
    values[place:] += 15.0 * sign * NOISE
    point = found(series(values))
    assert point.probability < 1e-4
    assert point.place == point.earliest == point.latest == place
    assert abs(point.step - 15.0 * sign * NOISE) < 3.0 * point.halfwidth


def test_the_interval_of_the_time_holds_it() -> None:
    rng, held = np.random.default_rng(3), 0
    for seed in range(300):
        place, values = int(rng.integers(2, 19)), scattered(seed, 20, 3.0)
        values[place:] += 9.0 * NOISE
        point = found(series(values))
        held += point.earliest <= place <= point.latest
    assert held >= scipy.stats.binom.ppf(0.001, 300, 0.95)


@given(SEEDS, st.integers(3, 25), st.floats(-1.0, 1.0))
def test_level_sign_and_direction_of_time_do_not_matter(
    seed: int, count: int, level: float
) -> None:
    values = scattered(seed, count)
    point = found(series(values))
    for other in (values + level, -values, values[::-1]):
        assert found(series(other)).probability == pytest.approx(point.probability, rel=1e-6)


def test_a_change_of_motion_is_no_change_of_the_scanner() -> None:
    values = scattered(1, 20)
    values[10:] += ERROR
    switched = [0] * 10 + [1] * 10
    assert found(series(values)).probability < 1e-6
    assert found(series(values, switched)).probability == 1.0


def test_what_exceeds_the_models_error_is_a_change_in_any_motion() -> None:
    values = scattered(1, 20)
    values[10:] += 40.0 * ERROR
    switched = [0] * 10 + [1] * 10
    point = found(series(values, switched))
    assert point.probability < 1e-4
    assert point.place == 10
    assert found(series(values[9:11])).probability < 1e-4


def test_the_models_error_does_not_shrink_with_the_number_of_recordings() -> None:
    values = scattered(1, 400)
    values[200:] += 5.0 * ERROR
    assert found(series(values, list(range(400)))).probability == 1.0


def test_what_cannot_be_told_is_not_tested() -> None:
    assert change_point(series(np.zeros(1))) is None
    assert change_point(series(np.array([0.0, 1.0]), error=np.inf)) is None
    assert change_point(series(np.array([0.0, 1.0, 2.0]), [0, 1, 2], error=np.inf)) is None


def test_a_sensor_without_noise_is_judged_by_its_scatter() -> None:
    silent = evolve(series(scattered(1, 20)), noise=np.zeros(20))
    assert found(silent).probability > 0.01


DAY = 86_400 * 10**9


def recording(instrument: str, night: int, gain: float, effect: str = "") -> Recording:
    axis = SurveyedAxis("x", 1e-9, 1e-9, (QuantityEstimate("gain", gain, NOISE, 1e-2),))
    named = (NamedEffect(effect, "", "x", 0.99, ()),) if effect else ()
    return Recording(
        bag=f"{instrument}/{night}",
        instrument=instrument,
        identity="",
        model="m",
        version="1",
        recorded=(1 + night) * DAY,
        scan_id=f"{instrument} {night}",
        motion="one",
        verdict="effect_found" if effect else "model_sufficient",
        axes=(axis,),
        effects=named,
    )


def nights(instrument: str, seed: int, step: float = 0.0, effect: str = "") -> list[Recording]:
    values = np.exp(NOISE * np.random.default_rng(seed).standard_normal(20))
    values[12:] *= np.exp(step)
    return [
        recording(instrument, n, float(value), effect if n >= 12 else "")
        for n, value in enumerate(values)
    ]


def test_the_one_that_changed_is_named_with_time_and_effect() -> None:
    some = [*nights("a", 1), *nights("b", 2, 20 * NOISE, "delay"), *nights("c", 3)]
    (change,) = changes(some, 0.01)
    assert (change.instrument, change.axis, change.name) == ("b", "x", "gain")
    assert (change.after, change.before) == (12 * DAY, 13 * DAY)
    assert change.effects == ("delay",)
    assert change.point.step == pytest.approx(20 * NOISE, rel=0.1)


def test_an_effect_that_was_there_before_did_not_come_with_the_change() -> None:
    some = [evolve(e, verdict="effect_found") for e in nights("a", 1, 20 * NOISE, "delay")]
    delay = some[-1].effects
    (change,) = changes([evolve(each, effects=delay) for each in some], 0.01)
    assert change.effects == ()


def test_an_ambiguous_diagnosis_names_nothing() -> None:
    some = nights("a", 1, 20 * NOISE, "delay")
    (change,) = changes([evolve(each, verdict="ambiguous") for each in some], 0.01)
    assert change.effects == ()


def test_the_probability_is_over_all_series() -> None:
    one = nights("a", 1, 5 * NOISE)
    (alone,) = changes(one, 0.5)
    many = [each for n in range(9) for each in nights(f"b{n}", 10 + n)]
    (among,) = changes([*one, *many], 0.5)
    assert among.point.probability == pytest.approx(10 * alone.point.probability)
    assert changes([*one, *many], 0.99 * among.point.probability) == []


def test_recordings_come_in_any_order() -> None:
    some = [*nights("a", 1), *nights("b", 2, 20 * NOISE)]
    assert changes(some[::-1], 0.01) == changes(some, 0.01)


def test_trends_have_what_is_comparable() -> None:
    some = nights("a", 1)
    untimed, failed = evolve(some[0], recorded=0), evolve(some[1], error="no bag")
    other, again = evolve(some[2], model="older"), evolve(some[3], bag="copy")
    left = usable([untimed, failed, other, *some[3:], again])
    assert [each.recorded for each in left] == [each.recorded for each in some[3:]]
