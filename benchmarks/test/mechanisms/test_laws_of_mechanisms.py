"""Laws that hold for every mechanism, of the evidence as of the product."""

from functools import partial

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.diagnosis.unmodelled.sets import (
    DEVELOPMENT_MECHANISMS,
    FORMERLY_HELD_OUT,
    HELD_OUT_MECHANISMS,
)
from afm_scan_bench.mechanisms.sizes import ALL, PAIRS, sized
from afm_scan_ros.core.types import AXES
from afm_scan_ros.simulation.mechanisms import environment
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers import mechanism_laws as laws
from helpers.mechanism_laws import X, run

every_effect = pytest.mark.parametrize("effect", ALL)


@every_effect
@settings(deadline=None, max_examples=5)
@given(cuts=st.sets(st.integers(1, X.size - 1), max_size=5), axis=st.sampled_from(AXES))
def test_cutting_into_blocks_changes_nothing(
    plant: PlantSpec, effect: str, cuts: set[int], axis: str
) -> None:
    laws.cutting_into_blocks_changes_nothing(plant, sized(effect, "large", axis), cuts)


@every_effect
@pytest.mark.parametrize("axis", AXES)
def test_it_moves_its_axis_alone_and_more_the_larger(
    plant: PlantSpec, effect: str, axis: str
) -> None:
    each = partial(sized, effect, axis=axis)
    laws.it_moves_its_axis_alone_and_more_the_larger(plant, each, axis)


@every_effect
def test_the_future_does_not_act(plant: PlantSpec, effect: str) -> None:
    laws.the_future_does_not_act(plant, sized(effect, "large", "x"))


@every_effect
def test_the_step_of_integration_does_not_matter(
    plant: PlantSpec, effect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    laws.the_step_of_integration_does_not_matter(plant, sized(effect, "large", "x"), monkeypatch)


def test_every_kind_is_tested() -> None:
    """Those that depend on the scanner's age are, in a file of their own."""
    tested = {each.KIND for name in ALL for each in sized(name, "large", "x")}
    by_age = {
        name for name, kind in Mechanism.KINDS.items() if kind.__module__ == environment.__name__
    }
    assert tested | by_age == set(Mechanism.KINDS)


def test_every_effect_is_of_one_set() -> None:
    sets = (HELD_OUT_MECHANISMS, *FORMERLY_HELD_OUT.values())
    names = [name for each in sets for name in each]
    assert len(names) == len(set(names))
    assert set(names) <= set(ALL)
    assert {*DEVELOPMENT_MECHANISMS, *HELD_OUT_MECHANISMS} == set(ALL)
    assert not {*HELD_OUT_MECHANISMS} & {*DEVELOPMENT_MECHANISMS}


@pytest.mark.parametrize("effects", PAIRS)
def test_pairs_are_pairs_of_effects(plant: PlantSpec, effects: tuple[str, str]) -> None:
    first, second = (sized(effect, "large", "x") for effect in effects)
    both = run(evolve(plant, mechanisms=(*first, *second)))
    for one in (first, second):
        assert np.std(both - run(evolve(plant, mechanisms=one))) > 1e-8
