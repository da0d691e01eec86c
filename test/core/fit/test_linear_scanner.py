"""A scanner without hysteresis is fitted by its vibration alone."""

from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.core.model import Status
from helpers.duffing import Oscillator, multisine

PERIOD, FINER, COUNT, NOISE = 1.0 / 610.0, 8, 6000, 1e-10
SCANNER = Oscillator()


def recorded(seed: int, intersample: str) -> afm.Record:
    """Return a record of waves to 92 Hz, seven samples a period of the highest."""
    fine = multisine(FINER * COUNT, seed, share=0.3 / FINER)
    moved = SCANNER.moved(fine, PERIOD / FINER)[::FINER]
    moved = moved + NOISE * np.random.default_rng(seed).standard_normal(COUNT)
    given = fine[::FINER], moved, PERIOD
    return afm.Record(*given, start="depolarised", intersample=intersample)


@pytest.fixture(scope="module")
def model() -> afm.Model:
    """A model of a record that states that its drive was measured."""
    return afm.identify([recorded(1, "band_limited")], linear=True)


def test_what_is_left_of_it_is_noise(model: afm.Model) -> None:
    fresh = recorded(2, "band_limited")
    left = fresh.displacement - model.predict(fresh.drive, PERIOD, intersample="band_limited")
    assert np.std(left) < 1.5 * NOISE
    resonance, _ = model.effects["x"].vibration.intervals
    assert resonance.lower is not None
    assert resonance.upper is not None
    assert resonance.lower < SCANNER.omega / (2.0 * np.pi) < resonance.upper
    assert resonance.upper - resonance.lower < 0.1


def test_a_measured_drive_taken_for_a_held_one_is_not_explained(model: afm.Model) -> None:
    found = afm.identify([recorded(1, "held")], linear=True)
    (held,), (measured,) = (one.fit.axes["x"].records for one in (found, model))
    assert measured.misfit.sigma < 1.5 * NOISE
    assert held.misfit.sigma > 5.0 * NOISE


def test_its_hysteresis_is_a_straight_line_that_was_assumed(
    model: afm.Model, tmp_path: Path
) -> None:
    assert model.effects["x"].hysteresis.status is Status.ASSUMED
    model.save(tmp_path / "model.yaml")
    drive = np.sin(np.linspace(0.0, 20.0, 500))
    there = afm.load_model(tmp_path / "model.yaml").predict(drive, PERIOD)
    assert np.allclose(there, model.predict(drive, PERIOD), rtol=1e-9, atol=0.0)
