"""Laws that hold for every mechanism."""

from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation import chain
from afm_scan_ros.simulation.mechanisms.delayed_converter import DelayedConverter
from afm_scan_ros.simulation.mechanisms.kinds import KINDS
from afm_scan_ros.simulation.mechanisms.sizes import ALL, PAIRS, SIZES, sized
from afm_scan_ros.simulation.scanner import Piezoscanner
from afm_scan_ros.simulation.spec import PlantSpec

PERIOD = 3.3e-5
TIME = np.arange(1200) * PERIOD
X = 3.0 * np.sin(300.0 * TIME) * np.minimum(1.0, 100.0 * TIME)
Y = 2.0 * np.sin(90.0 * TIME)

every_effect = pytest.mark.parametrize("effect", ALL)


def run(plant: PlantSpec, *cuts: int, x: Array = X, y: Array = Y, period: float = PERIOD) -> Array:
    """True displacement, m, shape (2, n)."""
    scanner = Piezoscanner(plant, period, seed=3)
    edges = [0, *cuts, x.size]
    blocks = (Trace(a, period, x[a:b], y[a:b]) for a, b in pairwise(edges))
    return np.hstack([[path.x, path.y] for _, path in map(scanner.advance, blocks)])


@every_effect
@settings(deadline=None, max_examples=5)
@given(cuts=st.sets(st.integers(1, X.size - 1), max_size=5), axis=st.sampled_from(AXES))
def test_cutting_into_blocks_changes_nothing(
    plant: PlantSpec, effect: str, cuts: set[int], axis: str
) -> None:
    altered = evolve(plant, mechanisms=sized(effect, "large", axis))
    np.testing.assert_array_equal(run(altered, *sorted(cuts)), run(altered))


@every_effect
@pytest.mark.parametrize("axis", AXES)
def test_it_moves_its_axis_alone_and_more_the_larger(
    plant: PlantSpec, effect: str, axis: str
) -> None:
    healthy, row = run(plant), AXES.index(axis)
    altered = [run(evolve(plant, mechanisms=sized(effect, size, axis))) for size in SIZES]
    moved = [np.std((each - healthy)[row]) for each in altered]
    assert 0.0 < moved[0] < moved[1] < moved[2]
    for each in altered:
        np.testing.assert_allclose(each[1 - row], healthy[1 - row], rtol=0, atol=1e-13)


@every_effect
def test_the_future_does_not_act(plant: PlantSpec, effect: str) -> None:
    altered = evolve(plant, mechanisms=sized(effect, "large", "x"))
    changed = X + np.where(np.arange(X.size) >= 700, 0.5, 0.0)
    first, second = run(altered), run(altered, x=changed)
    np.testing.assert_array_equal(second[:, :701], first[:, :701])
    assert np.any(second[:, 701:] != first[:, 701:])


def test_every_kind_is_tested() -> None:
    tested = {each.KIND for name in ALL for each in sized(name, "large", "x")}
    assert tested == set(KINDS)


@pytest.mark.parametrize("effects", PAIRS)
def test_pairs_are_pairs_of_effects(plant: PlantSpec, effects: tuple[str, str]) -> None:
    first, second = (sized(effect, "large", "x") for effect in effects)
    both = run(evolve(plant, mechanisms=(*first, *second)))
    for one in (first, second):
        assert np.std(both - run(evolve(plant, mechanisms=one))) > 1e-8


@every_effect
def test_the_step_of_integration_does_not_matter(
    plant: PlantSpec, effect: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    altered = evolve(plant, mechanisms=sized(effect, "large", "x"))
    healthy, coarse = run(plant), run(altered)
    monkeypatch.setattr(chain, "STEP", 1e-6)
    assert np.std((run(altered) - coarse)[0]) < 0.002 * np.std((coarse - healthy)[0])


@settings(deadline=None, max_examples=20)
@given(samples=st.integers(0, 12))
def test_a_delay_of_whole_samples_shifts(plant: PlantSpec, samples: int) -> None:
    delay = DelayedConverter(axis="x", delay=samples * PERIOD)
    late, punctual = run(evolve(plant, mechanisms=(delay,)))[0], run(plant)[0]
    np.testing.assert_allclose(late[samples:], punctual[: X.size - samples], atol=1e-14)
    assert not late[: samples + 1].any()
