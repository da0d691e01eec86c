"""The default plant is not an easy one, as its measured figures show."""

import csv
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from afm_scan_bench.characterise import Measurement, incongruency, measure_plant
from afm_scan_ros.simulation.scanner import PlantSpec

BOUNDS = [
    ("effective input at -4 V", -6.0, -5.85),
    ("effective input at 4 V", 5.1, 5.2),
    ("width of the major loop / range", 12.0, 16.0),
    ("incongruency of minor loops / range", 0.1, 0.6),
    ("gain at +-0.04 V above vanishing", 1.0, 5.0),
    ("phase lag at +-0.04 V", 0.3, 2.0),
    ("first peak / static gain", 28.6, 28.7),
    ("mode beside the polynomials / first peak", 5.0, 10.0),
    ("noise of the sensor, rms", 2.0, 2.1),
]


@pytest.fixture(scope="module")
def measured(plant: PlantSpec) -> list[Measurement]:
    return measure_plant(plant)


@pytest.mark.parametrize(("name", "lowest", "highest"), BOUNDS)
def test_the_default_plant_is_not_an_easy_one(
    measured: list[Measurement], name: str, lowest: float, highest: float
) -> None:
    values = {each.axis: each.value for each in measured if each.property == name}
    assert set(values) == {"x", "y"}
    assert all(lowest <= value <= highest for value in values.values()), values


def test_the_quantum_is_the_span_over_all_codes(
    plant: PlantSpec, measured: list[Measurement]
) -> None:
    quanta = [each.value for each in measured if each.property == "quantum of the sensor"]
    np.testing.assert_allclose(quanta, 1e9 * plant.sensor.span / 2**16)


def test_only_the_output_quadratic_makes_minor_loops_incongruent(plant: PlantSpec) -> None:
    even = evolve(plant.x, hysteresis=evolve(plant.x.hysteresis, output_quadratic=0.0))
    assert incongruency(even) < 1e-12 < incongruency(plant.x)


def test_a_plant_without_plays_has_no_loop(plant: PlantSpec) -> None:
    stiff = evolve(plant.x.hysteresis, density=0.0)
    found = measure_plant(evolve(plant, x=evolve(plant.x, hysteresis=stiff)))
    loop = {each.property: each.value for each in found if each.axis == "x"}
    assert loop["width of the major loop / range"] == pytest.approx(0.0, abs=1e-9)
    assert loop["phase lag at +-0.2 V"] == pytest.approx(0.0, abs=1e-9)


def test_the_documentation_states_what_is_measured(measured: list[Measurement]) -> None:
    table = Path(__file__).parents[2] / "docs/explanation/tables/simulated_scanner.csv"
    with table.open(encoding="utf-8", newline="") as file:
        stated = list(csv.reader(file))
    measured_x, measured_y = ([m for m in measured if m.axis == axis] for axis in "xy")
    for x, y in zip(measured_x, measured_y, strict=True):
        assert [x.property, f"{x.value:.4g}", f"{y.value:.4g}", x.unit] in stated
