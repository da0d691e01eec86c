"""The table of the constants states each number that decides a verdict, and no other."""

import csv
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

TABLE = Path(__file__).parents[3] / "docs/reference/tables/diagnosis_constants.csv"
WHOLE = (
    "axis_diagnosis",
    "discrepancy",
    "evidence",
    "likelihood",
    "preparation",
    "repetition",
    "search",
    "variance",
)
"""Modules that decide, and whose numbers are all in the table but those that only set precision."""
PRECISION = {"likelihood.SIZES", "discrepancy.SMALLEST", "discrepancy.FINER"}
ELSEWHERE = {"model": "core", "effect_type": "core.effects"}
PRECISION |= {"discrepancy.CUBIC_ORDER", "likelihood.PRECISION", "likelihood.ROUNDS"}
PRECISION |= {f"preparation.{name}" for name in ("FEWEST_SAMPLES", "LEVELS", "REFINEMENTS")}


def stated() -> dict[str, tuple[float, ...]]:
    """Numbers of the table by their names."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return {
            row["constant"].strip("`"): tuple(float(each) for each in row["value"].split(","))
            for row in csv.DictReader(file)
        }


def module(name: str) -> ModuleType:
    folder = ELSEWHERE.get(name, "core.diagnosis")
    return import_module(f"afm_scan_ros.{folder}.{name}")


@pytest.mark.parametrize("name", stated())
def test_the_table_states_the_number_of_the_code(name: str) -> None:
    where, constant = name.rsplit(".", 1)
    value = np.atleast_1d(getattr(module(where), constant))
    assert value == pytest.approx(np.array(stated()[name]), rel=5e-3)


@pytest.mark.parametrize("name", WHOLE)
def test_no_number_is_missing(name: str) -> None:
    """Names that a module imports are those of another one."""
    lines = Path(str(module(name).__file__)).read_text("utf-8").splitlines()
    assigned = [line.split(" = ")[0] for line in lines if line[:1].isupper() and " = " in line]
    own = {f"{name}.{each}" for line in assigned for each in line.split(", ") if each.isupper()}
    numbers = {
        each for each in own if isinstance(getattr(module(name), each.split(".")[1]), float | int)
    }
    assert numbers - PRECISION <= stated().keys()
