"""The inverse looks as far ahead as the model's response asks for."""

import paper
import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added, AxisModel, InverseSettings
from afm_scan_ros.core.scanner import chain_of

PERIOD = 2e-5


def preview(axis: AxisModel, seconds: float | None = None) -> float:
    """Preview (s) of the inverse with that of the settings."""
    settings = InverseSettings(preview=seconds)
    return chain_of(axis).vibration(PERIOD, settings).inverse.preview * PERIOD


def with_mode(damping: float) -> AxisModel:
    """Model that has a mode beside the others."""
    added = Added("extra_resonance", "parallel", (0.01, 800.0, damping))
    return evolve(paper.axis(), added=(added,))


@pytest.mark.parametrize("damping", [0.005, 0.01])
def test_a_mode_that_rings_long_is_looked_ahead_of(damping: float) -> None:
    assert preview(paper.axis()) < 0.02 < preview(with_mode(damping))


def test_a_preview_that_is_given_is_kept_to() -> None:
    assert preview(paper.axis(), 9e-3) == pytest.approx(9e-3)


def test_a_preview_that_is_too_short_is_refused_with_the_one_it_takes() -> None:
    with pytest.raises(InputError, match="give at least"):
        preview(with_mode(0.005), 0.01)
