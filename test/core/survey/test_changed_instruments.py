"""Which instruments changed: over all series together, and named as the diagnosis names it."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.survey.changed import changes, usable
from afm_scan_ros.core.survey.recording import Estimate, NamedEffect, Recording, SurveyedAxis

DAY = 86_400 * 10**9
NOISE = 1e-4


def recording(instrument: str, night: int, gain: float, effect: str = "") -> Recording:
    axis = SurveyedAxis("x", 1e-9, 1e-9, (Estimate("gain", gain, NOISE, 1e-2),))
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
