"""Laws that hold for every mechanism of the product, and how kinds are registered."""

from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from attrs import evolve, frozen
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.types import AXES
from afm_scan_ros.simulation.axis_spec import AxisSpec
from afm_scan_ros.simulation.mechanisms.amplifier import DelayedConverter
from afm_scan_ros.simulation.mechanisms.base import Alteration, Mechanism
from afm_scan_ros.simulation.mechanisms.registry import mechanism_type
from afm_scan_ros.simulation.mechanisms.sizes import EFFECTS, sized
from afm_scan_ros.simulation.spec import PlantSpec
from helpers import mechanism_laws as laws
from helpers.mechanism_laws import PERIOD, X, run

every_effect = pytest.mark.parametrize("effect", EFFECTS)


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


def test_every_kind_of_the_product_is_tested() -> None:
    assert mechanism_type("tilted_sensor") is not None
    ours = "afm_scan_ros.simulation.mechanisms."
    kinds = {kind for kind, each in Mechanism.KINDS.items() if each.__module__.startswith(ours)}
    assert {each.KIND for name in EFFECTS for each in sized(name, "large", "x")} == kinds


def test_a_class_that_states_a_kind_is_found_by_it_and_no_other_takes_it() -> None:
    @frozen(kw_only=True)
    class Unchanged(Alteration):
        KIND: ClassVar[str] = "unchanged"

        def altered(self, axis: AxisSpec) -> AxisSpec:
            return axis

    try:
        assert mechanism_type("unchanged") is Unchanged
        with pytest.raises(TypeError, match=r"Other: .*Unchanged has KIND 'unchanged'"):
            type("Other", (Alteration,), {"KIND": "unchanged"})
    finally:
        del Mechanism.KINDS["unchanged"]


@settings(deadline=None, max_examples=20)
@given(samples=st.integers(0, 12))
def test_a_delay_of_whole_samples_shifts(plant: PlantSpec, samples: int) -> None:
    delay = DelayedConverter(axis="x", delay=samples * PERIOD)
    late, punctual = run(evolve(plant, mechanisms=(delay,)))[0], run(plant)[0]
    np.testing.assert_allclose(late[samples:], punctual[: X.size - samples], atol=1e-14)
    assert not late[: samples + 1].any()
