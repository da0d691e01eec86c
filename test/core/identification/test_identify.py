"""Calibrate and identify the default plant: the model in config/, its accuracy, its origin."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.identification.drives.excitation import PLANS
from afm_scan_ros.core.identification.identify import (
    Identification,
    identify_records,
)
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant
from helpers.in_process import ALL, record, scan

pytestmark = pytest.mark.evidence

CONFIG = share_directory() / "config"
PLANT = load_plant(CONFIG / "plant.yaml")


@pytest.fixture(scope="module")
def found() -> Identification:
    made = {kind: record(plan(), PLANT, seed=1) for kind, plan in PLANS.items()}
    return identify_records([evolve(each, kind=kind) for kind, each in made.items()])


def test_the_model_identified_tracks_no_worse_than_the_default_one(found: Identification) -> None:
    spec = ScanSpec(line_rate=5.0, lines=6, samples_per_line=4000)
    models = found.model, load_model(CONFIG / "model.yaml")
    new, kept = (scan(spec, ALL, model=model).tracking("true").x.constant_speed for model in models)
    assert new is not None
    assert kept is not None
    assert new.rms_share < kept.rms_share


@pytest.mark.parametrize("axis", AXES)
def test_the_resonance_is_the_plant_s(found: Identification, axis: str) -> None:
    poles = np.roots(getattr(PLANT, axis).vibration.denominator)
    least = poles[np.argmin(-poles.real / np.abs(poles))]
    mode = first_resonance(found.model.axis(axis).vibration)
    assert mode.frequency == pytest.approx(abs(least) / (2.0 * np.pi), rel=2e-4)
    assert mode.damping == pytest.approx(-least.real / abs(least), rel=1e-2)


@pytest.mark.parametrize("axis", AXES)
def test_the_paper_s_inverse_is_no_worse_than_the_paper_s(found: Identification, axis: str) -> None:
    fitted = found.axes[axis]
    assert fitted.direct.sigma <= 0.0416  # Eq. 18, V
    assert fitted.direct.maximum <= 0.118  # Eq. 19, V
    assert fitted.deviation < 1e-3


def test_the_model_discrepancy_is_that_of_the_validation_record(found: Identification) -> None:
    for axis in AXES:
        known = found.model.axis(axis).model_discrepancy
        assert known is not None
        assert known.record.startswith("validation:")
        assert np.linalg.norm(known.rms) < 3e-3 * np.linalg.norm(known.displacement)
        assert np.linalg.norm(known.noise) == pytest.approx(2e-9, rel=0.1)  # config/plant.yaml


@pytest.mark.parametrize("lowest", [0.5, -5.0])
def test_a_drive_that_stays_away_from_zero_is_identified(lowest: float) -> None:
    """The scanner then rests, as far as the model goes, at the limit that is nearest to 0 V."""
    rng, seconds = np.random.default_rng(1), 0.005 * np.arange(3000)
    growing = np.linspace(0.3, 1.0, len(seconds))
    drive = lowest + 1.5 + 1.5 * np.sin(2.0 * np.pi * seconds) * growing
    moved = 1e-5 * (drive + 0.02 * drive**2)
    record = Record(drive, moved + 5e-9 * rng.standard_normal(len(drive)), 0.005)
    (axis,) = identify_records([record], linear=True).axes.values()
    (left,) = axis.records
    assert left.misfit.sigma < 0.05 * np.std(moved)
