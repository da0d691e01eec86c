"""Scanners of five families of hysteresis: their operators, and what is identified of them."""

from functools import cache

import numpy as np
import pytest

from afm_scan_bench.families.operators import LIMIT, Plays, SlipElements, applied
from afm_scan_bench.families.scanners import FAMILIES, MAPS, FamilyScanner
from afm_scan_ros.core.identification.drives.excitation import (
    excitation_block,
    hysteresis_plan,
    validation_plan,
)
from afm_scan_ros.core.identification.hysteresis.everett_fit import (
    TERMS,
    EverettFit,
    fit_everett,
    fit_forward,
    terms_that_serve,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import fresh_loops, reversal_curves
from afm_scan_ros.core.identification.records.motion import saturation_problems
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.types import Array

PLAN = hysteresis_plan()
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x[::10].copy()
CURVES = reversal_curves(DRIVE)
LEVELS = 51
NOISE = 2e-4
"""V; a sensor's 2 nm, of which every tenth sample is kept."""
METRES_PER_VOLT = 5.6e-6
"""Of effective input, on the default stage."""
WIPING = ("play", "slip", "preisach")
ALL_PAIRS = [(family, maps) for family in FAMILIES for maps in MAPS]


def effective(family: str, maps: str, drive: Array) -> Array:
    scanner = FamilyScanner.of(family, maps)
    noise = np.random.default_rng(1).standard_normal(len(drive))
    return scanner.gain * applied(scanner.operator, drive) + NOISE * noise


@cache
def fitted(family: str, maps: str) -> EverettFit:
    output = effective(family, maps, DRIVE)
    forward = fit_forward(DRIVE, output, CURVES, LEVELS)
    terms = terms_that_serve(DRIVE, output, CURVES, forward)
    forward = fit_forward(DRIVE, output, CURVES, LEVELS, forward.strength, terms)
    return fit_everett(DRIVE, output, CURVES, forward)


@cache
def errors(family: str, maps: str) -> dict[str, float]:
    """Sigma of each inverse on the loops after the curves, % of the drive's range."""
    output = effective(family, maps, DRIVE)
    fresh = fresh_loops(fitted(family, maps).model, DRIVE, output, CURVES.end)
    found = {"exact": fresh.exact, "direct": fresh.direct}
    return {name: 50.0 * misfit(each).sigma / LIMIT for name, each in found.items()}


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


@pytest.mark.parametrize(("family", "maps"), ALL_PAIRS)
def test_no_record_of_a_family_saturates(family: str, maps: str) -> None:
    plan = validation_plan()
    for drive in (DRIVE, excitation_block(plan, 0, plan.total_samples).y[::10].copy()):
        assert list(saturation_problems("x", drive, effective(family, maps, drive))) == []


@pytest.mark.parametrize("maps", MAPS)
@pytest.mark.parametrize("family", WIPING)
def test_operators_between_maps_are_identified(family: str, maps: str) -> None:
    assert errors(family, maps)[fitted(family, maps).model.inverse] < 0.05


@pytest.mark.parametrize("maps", MAPS)
@pytest.mark.parametrize("family", [each for each in FAMILIES if each not in WIPING])
def test_what_is_no_preisach_operator_gets_the_nearest(family: str, maps: str) -> None:
    assert errors(family, maps)[fitted(family, maps).model.inverse] < 1.5


@pytest.mark.parametrize(("family", "maps"), ALL_PAIRS)
def test_a_choice_is_for_the_better(family: str, maps: str) -> None:
    found = errors(family, maps)
    if fitted(family, maps).model.inverse == "direct":
        assert found["direct"] < found["exact"]


@pytest.mark.parametrize("family", ["play", "slip"])
def test_small_loops_in_the_middle_are_as_exact_as_large_ones(family: str) -> None:
    """A fiftieth of the range: the error as gain, offset and shape of the last loops."""
    scanner = FamilyScanner.of(family, "cube behind")
    output = effective(family, "cube behind", DRIVE)
    fit = fit_forward(DRIVE, output, CURVES, strength=0.01, terms=TERMS)
    fading = LIMIT * np.linspace(1.0, 0.0, 16) * np.resize([1.0, -1.0], 16)
    corners = np.concatenate([[0.0], fading, np.resize([0.01, -0.01], 6) * 2.0 * LIMIT])
    drive = np.interp(np.linspace(0, len(corners) - 1, 300 * len(corners)), np.arange(23), corners)
    wanted = scanner.gain * applied(scanner.operator, drive)
    operator = fit.operator
    error = operator.apply(operator.at_rest(), drive)[1] - wanted
    last = slice(-1200, None)
    gain, offset = np.polyfit(wanted[last], error[last], 1)
    shape = np.std(error[last] - gain * wanted[last])
    assert abs(gain) < 0.003
    assert abs(offset) < 10e-9 / METRES_PER_VOLT
    assert shape < 0.002 * np.ptp(wanted[last])
