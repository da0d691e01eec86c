"""Laws that hold for the mechanisms of the plant files, and how kinds are registered.

The evidence tests the same of every kind.
"""

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from attrs import evolve, frozen
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.axis import AxisSpec
from afm_scan_ros.simulation.mechanisms import mechanism_type
from afm_scan_ros.simulation.mechanisms.base import Alteration, Mechanism
from afm_scan_ros.simulation.mechanisms.electronics import DelayedConverter
from afm_scan_ros.simulation.scanner import PlantSpec
from helpers import mechanism_laws as laws
from helpers.mechanism_laws import PERIOD, X, run

PLANTS = sorted((share_directory() / "config/plants").glob("*.yaml"))
every_plant = pytest.mark.parametrize("path", PLANTS, ids=lambda path: path.stem)


@every_plant
@settings(deadline=None, max_examples=5)
@given(cuts=st.sets(st.integers(1, X.size - 1), max_size=5))
def test_cutting_into_blocks_changes_nothing(plant: PlantSpec, path: Path, cuts: set[int]) -> None:
    laws.cutting_into_blocks_changes_nothing(plant, load_plant(path).mechanisms, cuts)


@every_plant
def test_the_future_does_not_act(plant: PlantSpec, path: Path) -> None:
    laws.the_future_does_not_act(plant, load_plant(path).mechanisms)


@every_plant
def test_the_step_of_integration_does_not_matter(
    plant: PlantSpec, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mechanisms = load_plant(path).mechanisms
    laws.the_step_of_integration_does_not_matter(plant, mechanisms, monkeypatch)


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
