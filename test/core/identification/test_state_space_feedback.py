"""Elements in the feedback of a known structure: simulated as by stepping, and recovered."""

import numpy as np
import pytest
from attrs import frozen
from numpy.testing import assert_allclose
from test_state_space import PERIOD, random_form

from afm_scan_ros.core.effects.amplitude_softening import Softening
from afm_scan_ros.core.effects.effect_type import Actuators
from afm_scan_ros.core.effects.maxwell_slip import ElongationSlips
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.state_space.feedback import (
    FeedbackModel,
    SteadyRecords,
    fit_feedback,
)
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel

SAMPLES, LINES = 512, 220
HIGHEST = LINES / (SAMPLES * PERIOD)
BAND = (1.0 / (SAMPLES * PERIOD), HIGHEST)
AMPLITUDES = (0.5, 1.0, 2.0)
RECORDS = 4
THRESHOLD = 0.4


def structure(added: int, feedback: float) -> StateSpaceModel:
    """Two inputs, two outputs, six states; the added inputs act weakly and not at once."""
    form = random_form(3, 3, 0, 2, 2 + added)
    form.right[:, 2:] *= feedback
    form.feedthrough[:, 2:] = 0.0
    return form.realised(PERIOD)


def drives(amplitude: float, records: int = RECORDS, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    spectrum = np.zeros((SAMPLES // 2 + 1, 2, records), dtype=complex)
    spectrum[1 : LINES + 1] = np.exp(2j * np.pi * rng.random((LINES, 2, records)))
    drive = np.fft.irfft(spectrum, SAMPLES, axis=0)
    return amplitude * drive / drive.std()


def actuators(model: StateSpaceModel) -> Actuators:
    elongation = np.linalg.inv(model.response(np.zeros(1))[0].real[:, :2])
    return Actuators(np.ones(2), elongation, 1.0, PERIOD)


@frozen
class Cubes:
    """A stiffening without bound."""

    actuators: Actuators

    def added(self, drive: np.ndarray, output: np.ndarray, run: int) -> np.ndarray:  # noqa: ARG002
        return self.actuators.elongations(output) ** 3


def stepped(model: StateSpaceModel, matrix: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Four periods from rest, each play followed sample by sample in the loop."""
    state, play, outputs = np.zeros(model.order), np.zeros(2), []
    for u in np.tile(drive, (4, 1)):
        y = model.c @ state + model.d[:, :2] @ u
        z = matrix @ y
        play = np.clip(play, z - THRESHOLD, z + THRESHOLD)
        state = model.a @ state + model.b @ np.concatenate([u, z - play])
        outputs.append(y)
    return np.array(outputs)


@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_steady_state_is_what_stepping_settles_to(amplitude: float) -> None:
    linear = structure(added=2, feedback=0.05)
    scales, half_rate = actuators(linear), 0.5 / PERIOD
    model = FeedbackModel(linear, (ElongationSlips(scales, (THRESHOLD,)),), (0.0, half_rate))
    drive = drives(amplitude)
    expected = stepped(linear, scales.elongation, drive[:, :, 0])[-SAMPLES:]
    without = model.linear.steady_state(np.pad(drive[:, :, 0], ((0, 0), (0, 2))))
    found = model.steady_state(drive)[:, :, 0]
    assert np.linalg.norm(expected - without) > 0.01 * np.linalg.norm(expected)
    assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def test_a_run_from_rest_is_what_stepping_gives() -> None:
    linear = structure(added=2, feedback=0.05)
    scales = actuators(linear)
    model = FeedbackModel(linear, (ElongationSlips(scales, (THRESHOLD,)),), (0.0, 0.5 / PERIOD))
    drive = drives(1.0)[:, :, 0]
    expected = stepped(linear, scales.elongation, drive)
    found = model.from_rest(np.tile(drive, (4, 1)))
    assert np.linalg.norm(expected[:SAMPLES] - expected[-SAMPLES:]) > 1.0
    assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def records(truth: FeedbackModel, seed: int = 0) -> SteadyRecords:
    drive = np.concatenate([drives(a, seed=seed) for a in AMPLITUDES], axis=2)
    output = truth.steady_state(drive)
    weight = np.tile(np.repeat(1.0 / np.array(AMPLITUDES), RECORDS), (LINES, 1))
    used = np.zeros(SAMPLES // 2 + 1, dtype=bool)
    used[1 : LINES + 1] = True
    return SteadyRecords(drive, output, used, weight, PERIOD)


@pytest.mark.parametrize("element", ["softening", "slips"])
def test_what_acts_in_feedback_is_recovered(element: str) -> None:
    added, feedback = (4, 0.03) if element == "softening" else (2, 0.1)
    linear = structure(added, feedback)
    scales = actuators(linear)
    slips = ElongationSlips(scales, (THRESHOLD,))
    acting = Softening(scales) if element == "softening" else slips
    truth = FeedbackModel(linear, (acting,), BAND)
    known = records(truth)
    start = fit_state_space(known.spectra((), known.output), order=6)
    found = fit_feedback(known, start, (acting,))
    fresh = records(truth, seed=1)
    before, after = (
        np.linalg.norm(model.steady_state(fresh.drive) - fresh.output)
        for model in (FeedbackModel(start, (), BAND), found)
    )
    assert before > 0.01 * np.linalg.norm(fresh.output)
    assert after < 1e-3 * before
    assert_allclose(np.sort_complex(found.linear.poles), np.sort_complex(linear.poles), atol=1e-3)


def test_what_does_not_settle_is_said() -> None:
    linear = structure(added=2, feedback=1.0)
    model = FeedbackModel(linear, (Cubes(actuators(linear)),), BAND)
    with pytest.raises(ScanError, match=r"simulation: not settled in [0-9]+ rounds.* move less"):
        model.steady_state(drives(10.0))


def test_nothing_is_put_out_beyond_the_lines_identified() -> None:
    model = FeedbackModel(structure(added=0, feedback=0.0), (), (0.0, HIGHEST / 2.0))
    found = np.abs(np.fft.rfft(model.steady_state(drives(1.0)), axis=0))
    assert found[1 : LINES // 2].min() > 0.0
    assert found[LINES // 2 + 1 :].max() < 1e-9 * found.max()
