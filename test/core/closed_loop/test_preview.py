"""The inverses look as far ahead as the model's response asks for, and no less far."""

import paper
import pytest
from attrs import evolve

from afm_scan_ros.core.compensation import LEAST_PREVIEW, preview_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added, InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import compensator

PERIOD = 2e-5
MODEL = ScannerModel(x=paper.axis(), y=paper.axis())


def with_mode(damping: float) -> ScannerModel:
    """Model of which y has a mode beside the others."""
    added = Added("extra_resonance", "parallel", (0.01, 800.0, damping))
    return evolve(MODEL, y=evolve(MODEL.y, added=(added,)))


def begins(model: ScannerModel, preview: float) -> None:
    settings = InverseSettings(preview=preview)
    compensator(model.y, PERIOD, ("vibration",), settings).inverse_at_rest()


def test_a_well_damped_model_asks_for_no_more_than_the_least() -> None:
    assert preview_of(MODEL, PERIOD) == LEAST_PREVIEW
    assert preview_of(MODEL, PERIOD, least=0.0) < LEAST_PREVIEW


@pytest.mark.parametrize("damping", [0.005, 0.01])
def test_a_mode_that_rings_long_is_looked_ahead_of(damping: float) -> None:
    model = with_mode(damping)
    ahead = preview_of(model, PERIOD)
    assert ahead > LEAST_PREVIEW
    begins(model, ahead)
    with pytest.raises(InputError, match="give at least"):
        begins(model, ahead - PERIOD)
