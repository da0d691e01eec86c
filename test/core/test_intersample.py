"""A drive that was measured runs on between its samples; one that was commanded is held."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import afm_scan_ros as afm
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel, resonant
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.intersample import BAND_LIMITED, HELD, held_voltages, moved_by

PERIOD, COUNT = 1e-3, 4000
RESONANCE = VibrationModel((2e5,), tuple(resonant(2.0 * np.pi * 100.0, 0.05)))


def forward(model: VibrationModel, sample_period: float) -> Cascade:
    """Return the vibration alone."""
    return Cascade((Vibration(model, sample_period),))


@given(st.floats(20.0, 300.0))
def test_a_sine_between_samples_moves_a_resonance_as_its_response_says(frequency: float) -> None:
    """Held at ten samples a period, a sine would be 18 degrees late and 2 % weaker."""
    omega, time = 2.0 * np.pi * frequency, PERIOD * np.arange(COUNT)
    faded = np.minimum(1.0, time / 0.5)
    moved = moved_by(
        partial(forward, RESONANCE), faded * np.sin(omega * time), PERIOD, BAND_LIMITED
    )
    (there,) = RESONANCE.response(np.array([omega]))
    expected = (there * np.exp(1j * omega * time)).imag
    middle = slice(1500, 3500)
    assert np.abs(moved - expected)[middle].max() < 2e-3 * abs(there) + 1e-5


def test_a_held_drive_is_what_it_was() -> None:
    drive = np.random.default_rng(1).standard_normal(100)
    assert held_voltages(drive, HELD) is drive


def test_predictions_are_of_the_samples_that_were_given() -> None:
    """A slow drive moves a scanner alike, however it runs between samples."""
    drive = np.sin(np.linspace(0.0, 2.0 * np.pi, 4000)) ** 3
    drive = np.column_stack([drive, 0.5 * drive])
    held, between = (
        afm.load_model().predict(drive, 1e-4, intersample=each) for each in (HELD, BAND_LIMITED)
    )
    assert between.shape == held.shape
    assert np.abs(between - held).max() < 1e-3 * np.ptp(held)
    assert np.abs(between - held).max() > 0.0


@pytest.mark.parametrize("make", [afm.Record, afm.load_model().predict])
def test_an_unknown_behaviour_is_refused(make: object) -> None:
    assert callable(make)
    given = np.zeros(20) if make is afm.Record else np.zeros((20, 2))
    arguments = (given, given, 1e-3) if make is afm.Record else (given, 1e-3)
    with pytest.raises(InputError, match="intersample 'linear' is unknown: give one of held"):
        make(*arguments, intersample="linear")
