"""The descriptions of the effects are complete and consistent."""

import re
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core import effects
from afm_scan_ros.core.effects.effect_type import REGISTERED, EffectType, register
from afm_scan_ros.core.effects.registry import (
    CATALOGUE,
    EFFECTS,
    effect_type,
    symmetric,
)
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS

every_effect = pytest.mark.parametrize("name", [each.name for each in CATALOGUE])


def test_effects_stand_in_alphabetical_order() -> None:
    """The search tries them in this order."""
    names = [each.name for each in EFFECTS]
    assert names == sorted(set(names))
    base = {each.name for each in EFFECTS if not (each.forms or each.feedback)}
    assert base == {"creep", "hysteresis", "vibration"}


def test_every_module_that_describes_an_effect_is_found() -> None:
    files = [*Path(effects.__file__).parent.rglob("*.py")]
    described = sum(path.read_text("utf-8").count("\n@register\n") for path in files)
    assert described == len(EFFECTS)


@every_effect
def test_being_confusable_is_mutual(name: str) -> None:
    found = effect_type(name)
    assert list(found.confusable) == sorted(set(found.confusable) - {name})
    for other in found.confusable:
        assert name in effect_type(other).confusable


def test_each_pair_is_declared_once_and_counts_for_both() -> None:
    pairs = [(each.name, other) for each in REGISTERED.values() for other in each.confusable]
    assert len({frozenset(pair) for pair in pairs}) == len(pairs)
    assert "slew_limit" in effect_type("input_lag").confusable
    assert "input_lag" in effect_type("slew_limit").confusable
    assert "slew_limit" not in effect_type("delay").confusable


@pytest.mark.parametrize("other", ["delay", "nothing"])
def test_an_effect_is_confusable_with_another_one_that_exists(other: str) -> None:
    declared = evolve(effect_type("delay"), confusable=(other,))
    with pytest.raises(InputError, match=f"delay is declared confusable with '{other}': name ano"):
        symmetric([declared])


def test_two_effects_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="two effects are named 'delay': rename one"):
        register(lambda: effect_type("delay"))


@pytest.mark.parametrize("found", EFFECTS, ids=lambda each: each.name)
def test_the_physics_is_stated(found: EffectType) -> None:
    assert found.physics
    assert found.source.endswith(".")
    assert bool(found.parameters) != bool(found.forms or found.feedback)


@pytest.mark.parametrize("found", EFFECTS, ids=lambda each: each.name)
def test_the_experiment_is_one_that_can_be_made(found: EffectType) -> None:
    assert found.experiment in (EXPERIMENTS if found.forms or found.feedback else PLANS)


@every_effect
def test_the_equation_names_every_parameter(name: str) -> None:
    found = effect_type(name)
    for form in found.forms:
        for parameter in form.parameters:
            named = re.sub("_([3-9]|[12][0-9])$", "_2", parameter.name)  # "and on"
            assert named in found.equation.replace(" w ", " frequency ")


def test_an_unknown_effect_is_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"'magic': choose among .*cross_coupling"):
        effect_type("magic")


def test_an_unknown_kind_is_refused_by_name() -> None:
    with pytest.raises(InputError, match="cross_coupling has no kind 'odd': choose among 'static'"):
        effect_type("cross_coupling").form("odd")


@pytest.mark.parametrize(("name", "kind"), [(e.name, f.kind) for e in CATALOGUE for f in e.forms])
@settings(deadline=None, max_examples=10)
@given(
    seed=st.integers(0, 1000),
    lines=st.lists(st.floats(0.0, 1e4), max_size=4),
    height=st.sampled_from([0.0, 1e-5]),
)
def test_a_fit_can_start(
    name: str, kind: str, seed: int, lines: list[float], height: float
) -> None:
    random = np.random.default_rng(seed)
    moved = height * random.normal(size=500)
    features = ResidualFeatures(
        5e-5, moved / 1e-5, moved, random.normal(0.0, 1e-8, 500), moved, tuple(lines)
    )
    form = effect_type(name).form(kind)
    starts = list(form.starts(features))
    assert len(starts) <= 36
    assert starts or name == "periodic_disturbance"  # whose combs have none without a line
    for start in starts:
        for parameter, value in zip(form.parameters, start, strict=True):
            assert parameter.lower <= value <= parameter.upper
