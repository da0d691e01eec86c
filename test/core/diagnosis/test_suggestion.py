"""An equation is found in the data where there is one, and none where there is not."""

from collections.abc import Callable

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.suggestion import Suggestion, suggest
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(lines=4, samples_per_line=500)
MICRO, NANO = 1e-6, 1e-9
Error = Callable[[Array, Array], Array]
"""What is added to x (m), of x and y (m)."""


@pytest.fixture(scope="module")
def healthy() -> Record:
    done = scan(SPEC, ALL)
    return Record.of_traces("scan", done.drive, done.measured, SPEC)


def suggested(healthy: Record, error: Error) -> Suggestion | None:
    """Suggestion for x, of which the sensor shows something in addition."""
    moved = healthy.displacement
    wrong = moved + np.outer(error(*moved.T), [1.0, 0.0])
    evidence = evidence_of("x", default_model(), evolve(healthy, displacement=wrong))
    return suggest("x", (evidence,), chain_of(default_model().x))


def found(healthy: Record, error: Error) -> Suggestion:
    suggestion = suggested(healthy, error)
    assert suggestion is not None
    return suggestion


def test_gain_that_depends_on_the_other_axis_is_a_product(healthy: Record) -> None:
    suggestion = found(healthy, lambda x, y: 1e-3 * (x / MICRO) * (y / MICRO) * MICRO)
    assert suggestion.symbols == ("x y",)
    assert suggestion.coefficients == (pytest.approx(1.0, rel=0.02),)
    assert suggestion.explained > 0.95
    assert "nm/µm² x y" in suggestion.equation


@pytest.mark.parametrize("length", [0.7, 2.5])
def test_cyclic_error_is_a_wave_of_position(healthy: Record, length: float) -> None:
    suggestion = found(
        healthy, lambda x, _: 60.0 * NANO * np.sin(2.0 * np.pi * x / (length * MICRO) + 0.5)
    )
    symbols = suggestion.symbols[:2]
    assert [symbol[:8] for symbol in symbols] == ["sin(2π x", "cos(2π x"]
    assert float(symbols[0].split()[3]) == pytest.approx(length, rel=0.01)
    assert np.hypot(*suggestion.coefficients[:2]) == pytest.approx(60.0, rel=0.1)


def test_the_simplest_of_what_does_as_well_is_taken(healthy: Record) -> None:
    suggestion = found(healthy, lambda _, y: 5e-3 * y)
    assert suggestion.symbols == ("y",)
    assert suggestion.coefficients == (pytest.approx(5.0, rel=0.05),)


def test_nothing_is_suggested_of_a_residual_at_its_floor(healthy: Record) -> None:
    assert suggested(healthy, lambda x, _: np.zeros_like(x)) is None


def test_nothing_is_suggested_of_noise(healthy: Record) -> None:
    noise = np.random.default_rng(5).normal(0.0, 50.0 * NANO, len(healthy.drive))
    assert suggested(healthy, lambda _, y: noise + 0.0 * y) is None
