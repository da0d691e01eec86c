"""Elements in the feedback of a known structure: simulated as by stepping, and recovered."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_state_space import PERIOD, random_form

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.identification.state_space.elements import Powers, Slips, Softening
from afm_scan_ros.core.identification.state_space.feedback import (
    FeedbackModel,
    SteadyRecords,
    fit_feedback,
)
from afm_scan_ros.core.identification.state_space.fit import fit_state_space
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel

SAMPLES, LINES = 512, 220
HIGHEST = LINES / (SAMPLES * PERIOD)
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


def elongation(model: StateSpaceModel) -> np.ndarray:
    return np.linalg.inv(model.response(np.zeros(1))[0].real[:, :2])


def stepped(model: StateSpaceModel, matrix: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Last of four periods, each play followed sample by sample in the loop."""
    state, play, outputs = np.zeros(model.order), np.zeros(2), []
    for u in np.tile(drive, (4, 1)):
        y = model.c @ state + model.d[:, :2] @ u
        z = matrix @ y
        play = np.clip(play, z - THRESHOLD, z + THRESHOLD)
        state = model.a @ state + model.b @ np.concatenate([u, z - play])
        outputs.append(y)
    return np.array(outputs[-SAMPLES:])


@pytest.mark.parametrize("amplitude", AMPLITUDES)
def test_steady_state_is_what_stepping_settles_to(amplitude: float) -> None:
    linear = structure(added=2, feedback=0.05)
    matrix, half_rate = elongation(linear), 0.5 / PERIOD
    model = FeedbackModel(linear, (Slips((THRESHOLD,), matrix),), half_rate)
    drive = drives(amplitude)
    expected = stepped(linear, matrix, drive[:, :, 0])
    without = model.linear.steady_state(np.pad(drive[:, :, 0], ((0, 0), (0, 2))))
    found = model.steady_state(drive)[:, :, 0]
    assert np.linalg.norm(expected - without) > 0.01 * np.linalg.norm(expected)
    assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())


def records(truth: FeedbackModel, seed: int = 0) -> SteadyRecords:
    drive = np.concatenate([drives(a, seed=seed) for a in AMPLITUDES], axis=2)
    output = truth.steady_state(drive)
    weight = np.tile(np.repeat(1.0 / np.array(AMPLITUDES), RECORDS), (LINES, 1))
    return SteadyRecords(drive, output, weight, PERIOD, HIGHEST)


@pytest.mark.parametrize("element", ["softening", "slips"])
def test_what_acts_in_feedback_is_recovered(element: str) -> None:
    added, feedback = (4, 0.03) if element == "softening" else (2, 0.1)
    linear = structure(added, feedback)
    matrix = elongation(linear)
    acting = Softening(matrix, 1.0) if element == "softening" else Slips((THRESHOLD,), matrix)
    truth = FeedbackModel(linear, (acting,), HIGHEST)
    known = records(truth)
    start = fit_state_space(known.spectra((), known.output), order=6)
    found = fit_feedback(known, start, (acting,))
    fresh = records(truth, seed=1)
    before, after = (
        np.linalg.norm(model.steady_state(fresh.drive) - fresh.output)
        for model in (FeedbackModel(start, (), HIGHEST), found)
    )
    assert before > 0.01 * np.linalg.norm(fresh.output)
    assert after < 1e-3 * before
    assert_allclose(np.sort_complex(found.linear.poles), np.sort_complex(linear.poles), atol=1e-3)


def test_what_does_not_settle_is_said() -> None:
    linear = structure(added=2, feedback=1.0)
    model = FeedbackModel(linear, (Powers((3,), elongation(linear)),), HIGHEST)
    with pytest.raises(ScanError, match="drive less"):
        model.steady_state(drives(10.0))


def test_nothing_is_put_out_beyond_the_lines_identified() -> None:
    model = FeedbackModel(structure(added=0, feedback=0.0), (), HIGHEST / 2.0)
    found = np.abs(np.fft.rfft(model.steady_state(drives(1.0)), axis=0))
    assert found[1 : LINES // 2].min() > 0.0
    assert found[LINES // 2 + 1 :].max() < 1e-9 * found.max()
