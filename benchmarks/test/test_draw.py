"""A drawn plant is another one of the same make."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_bench.draw import drawn
from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_ros.simulation.axis import AxisSpec, Dynamics, PlayBank
from afm_scan_ros.simulation.scanner import PlantSpec


def first_pole(axis: AxisSpec) -> complex:
    poles = np.roots(axis.vibration.denominator)
    return poles[np.argmin(-poles.real / np.abs(poles))]


def constants(axis: AxisSpec) -> list[float]:
    return sorted(-1.0 / np.roots(axis.creep.denominator).real)


def reach(axis: AxisSpec) -> list[float]:
    bank = PlayBank.from_spec(axis.hysteresis)
    return bank.apply(bank.relaxed(), np.array([4.0, -4.0]))[1].tolist()


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32))
def test_a_drawn_plant_is_sane(plant: PlantSpec, seed: int) -> None:
    new = drawn(plant, np.random.default_rng(seed))
    for before, after in ((plant.x, new.x), (plant.y, new.y)):
        was, now = first_pole(before), first_pole(after)
        assert 0.9 <= abs(now) / abs(was) <= 1.1
        ratios = [pole.real / abs(pole) for pole in (now, was)]
        assert 0.7 <= ratios[0] / ratios[1] <= 1.4
        shares = np.divide(constants(after), constants(before))
        assert np.all((shares >= 0.8) & (shares <= 1.2))
        static = [Dynamics.from_spec(a, 1.0).response(np.zeros(1))[0].real for a in (before, after)]
        assert static[1] == pytest.approx(static[0], rel=0.07)
        np.testing.assert_allclose(reach(after), reach(before), atol=0.25)
        assert np.subtract(*reach(after)) == pytest.approx(np.subtract(*reach(before)), rel=1e-9)


def test_every_parameter_is_drawn_and_by_the_seed(plant: PlantSpec) -> None:
    one, same, other = (drawn(plant, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert one == same
    for part in ("hysteresis", "vibration", "modes", "creep"):
        parts = [getattr(a, part) for p in (plant, one, other) for a in (p.x, p.y)]
        assert len({str(each) for each in parts}) == 6
    assert len({each.sensor.noise_rms for each in (plant, one, other)}) == 3


def test_mechanisms_stay(plant: PlantSpec) -> None:
    mechanisms = sized("delay", "small", "x")
    altered = evolve(plant, mechanisms=mechanisms)
    assert drawn(altered, np.random.default_rng(0)).mechanisms == mechanisms
