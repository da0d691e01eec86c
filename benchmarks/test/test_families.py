"""Scanners of five families of hysteresis: their operators, and what is identified of them."""

import numpy as np
import pytest

from afm_scan_bench.families.operators import LIMIT, Plays, SlipElements, applied
from afm_scan_bench.families.scanners import FAMILIES, MAPS, FamilyScanner
from afm_scan_ros.core.identification.drives.excitation import (
    excitation_block,
    hysteresis_plan,
    validation_plan,
)
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.identification.records.motion import saturation_problems

NOISE = 2e-4
"""V; a sensor's 2 nm, of which every tenth sample is kept."""


@pytest.mark.parametrize("family", FAMILIES)
def test_loops_are_as_wide_as_those_of_piezos(family: str) -> None:
    swing = LIMIT * np.linspace(-1.0, 1.0, 2001)
    path = applied(FAMILIES[family], np.concatenate([swing[1000:], -swing, swing]))
    fall, rise = path[-4002:-2001], path[-2001:]
    assert 0.11 < np.max(fall[::-1] - rise) / np.ptp(rise) < 0.14


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_does_not_depend_on_rate(family: str) -> None:
    coarse = LIMIT * np.sin(np.linspace(0.0, 8.0, 801)) * np.linspace(1.0, 0.2, 801)
    fine = np.interp(np.linspace(0.0, 800.0, 8001), np.arange(801.0), coarse)
    operator = FAMILIES[family]
    np.testing.assert_allclose(applied(operator, fine)[::10], applied(operator, coarse), atol=1e-9)


def test_slip_elements_are_the_inverse_of_stops() -> None:
    """A stop is the input less the play: together they make up the voltage."""
    drive = np.sin(np.linspace(0.0, 20.0, 3001)) * np.linspace(0.2, 2.0, 3001)
    charge = applied(SlipElements(np.array([0.15]), np.array([0.5])), drive)
    stop = 2.0 * charge - applied(Plays(np.array([0.3]), np.array([1.0])), charge)
    np.testing.assert_allclose(charge + 0.5 * stop, drive, atol=1e-9)


@pytest.mark.parametrize("maps", MAPS)
@pytest.mark.parametrize("family", FAMILIES)
def test_no_record_of_a_family_saturates(family: str, maps: str) -> None:
    scanner = FamilyScanner.of(family, maps)
    for plan in (hysteresis_plan(), validation_plan()):
        drive = excitation_block(plan, 0, plan.total_samples).x[::10].copy()
        noise = NOISE * np.random.default_rng(1).standard_normal(len(drive))
        moved = scanner.gain * applied(scanner.operator, drive) + noise
        assert list(saturation_problems("x", drive, moved)) == []


@pytest.mark.evidence
@pytest.mark.parametrize(("family", "operator"), [("slip", "plays"), ("bouc_wen", "one state")])
def test_the_operator_of_a_family_is_chosen(family: str, operator: str) -> None:
    """From one record of moves between random levels, between a square and a cubic map."""
    records = FamilyScanner.of(family, "square before, cube behind").records()
    found = identify_axis([records["hysteresis"], records["validation"]], "x")
    left = found.validations[0].model_discrepancy
    assert found.operator == operator
    assert np.linalg.norm(left.rms) < 2e-3 * np.linalg.norm(left.displacement)
