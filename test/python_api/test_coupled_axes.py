"""Three coupled axes, from their records to a model that predicts and inverts."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import afm_scan_ros as afm
from afm_scan_ros.files.arrays import SEAL

PERIOD, SAMPLES, LINES = 1e-3, 512, 200
AXES = ("a", "b", "c")
STRENGTHS = (0.5, 1.0, 2.0)
MODES = ((90.0, 0.03), (130.0, 0.02), (210.0, 0.015))
"""Resonances (Hz) and damping ratios."""
SETTLING = 4
"""Periods until the scanner is steady."""
FINER = 10
"""Steps of a sample."""


def multisine(seed: int, rms: float) -> np.ndarray:
    spectrum = np.zeros((SAMPLES // 2 + 1, 3), dtype=complex)
    rng = np.random.default_rng(seed)
    spectrum[1 : LINES + 1] = np.exp(2j * np.pi * rng.random((LINES, 3)))
    drive = np.fft.irfft(spectrum, SAMPLES, axis=0)
    return rms * drive / drive.std()


def moved(drives: np.ndarray, slipping: float = 0.0) -> np.ndarray:
    """Displacement (m) of three coupled modes whose springs yield in part, stepped in time.

    Drives and displacement (samples, records, 3).
    """
    shapes = np.array([[1.0, 0.4, -0.3], [-0.5, 1.0, 0.2], [0.3, -0.2, 1.0]])
    angular = 2.0 * np.pi * np.array([f for f, _ in MODES])
    damping = np.array([zeta for _, zeta in MODES])
    at, speed, play = np.zeros((3, *drives.shape[1:]))
    result, step = np.empty_like(drives), PERIOD / FINER
    for k, volts in enumerate(drives @ shapes):
        result[k] = 1e-6 * at @ shapes.T
        for _ in range(FINER):
            play = np.clip(play, at - 0.4, at + 0.4)
            force = volts - at - slipping * (at - play)
            speed = speed + step * (angular**2 * force - 2.0 * damping * angular * speed)
            at = at + step * speed
    return result


def recorded(seeds: Sequence[int], rms: float, slipping: float = 0.0) -> list[afm.Record]:
    """Two steady periods of each realisation, with noise of 1 nm."""
    once = np.stack([multisine(seed, rms) for seed in seeds], axis=1)
    drive = np.tile(once, (SETTLING + 2, 1, 1))
    found = moved(drive, slipping) + 1e-9 * np.random.default_rng(0).standard_normal(drive.shape)
    steady = slice(SETTLING * SAMPLES, None)
    return [
        afm.Record(drive[steady, k], found[steady, k], PERIOD, AXES, name=f"{rms} V, {seed}")
        for k, seed in enumerate(seeds)
    ]


@pytest.fixture(scope="module")
def records() -> list[afm.Record]:
    return recorded(range(5), 1.0)


@pytest.fixture(scope="module")
def model(records: list[afm.Record]) -> afm.Model:
    message: list[str] = []
    found = afm.identify(records, message.append)
    assert any("8 states" in sentence for sentence in message)
    return found


def share(residual: np.ndarray, of: np.ndarray) -> float:
    return float(np.linalg.norm(residual) / np.linalg.norm(of))


def test_the_order_is_found_and_a_fresh_record_is_predicted(model: afm.Model) -> None:
    (fresh,) = recorded([10], 1.0)
    found = model.predict(fresh.drive, PERIOD, periodic=True)
    assert model.axes == AXES
    assert 6 <= model.coupled.linear.order <= 10
    assert share(found - fresh.displacement, fresh.displacement) < 0.005
    (stated,) = model.coupled.errors
    assert stated.drive_rms == pytest.approx(1.0, rel=0.01)
    assert stated.error_rms == pytest.approx(1e-9, rel=0.5)


def test_a_run_from_rest_is_predicted(model: afm.Model) -> None:
    time = PERIOD * np.arange(4 * SAMPLES)
    hump = np.exp(-(((time - 0.9) / 0.1) ** 2))
    drive = np.stack([hump * np.sin(f * time) for f in (500.0, 800.0, 1300.0)], axis=1)
    expected = moved(drive[:, np.newaxis])[:, 0]
    assert share(model.predict(drive, PERIOD) - expected, expected) < 0.01


def test_the_drive_makes_the_scanner_follow(model: afm.Model) -> None:
    time = PERIOD * np.arange(4 * SAMPLES)
    hump = np.exp(-(((time - 1.0) / 0.1) ** 2))
    desired = 1e-6 * np.stack([hump * np.sin(f * time) for f in (100.0, 300.0, 500.0)], axis=1)
    followed = moved(model.invert(desired, PERIOD)[:, np.newaxis])[:, 0]
    assert share(followed - desired, desired) < 0.01


def test_a_file_gives_the_same_model(model: afm.Model, tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    model.save(path)
    again, drive = afm.load_model(path), multisine(12, 1.0)
    assert again.axes == AXES
    assert again.coupled.relative_error == pytest.approx(model.coupled.relative_error)
    assert np.array_equal(again.predict(drive, PERIOD), model.predict(drive, PERIOD))


@pytest.mark.evidence
def test_hysteresis_in_the_springs_is_identified_at_all_amplitudes(tmp_path: Path) -> None:
    made = [recorded(range(6), rms, 0.15) for rms in STRENGTHS]
    fitted, fresh = [one for level in made for one in level[:5]], [level[5] for level in made]
    without = afm.identify(fitted, states=6)
    found = afm.identify(fitted, effects=["amplitude_softening", "maxwell_slip"], states=6)
    for one in fresh:
        before, after = (
            share(
                each.predict(one.drive, PERIOD, periodic=True) - one.displacement, one.displacement
            )
            for each in (without, found)
        )
        assert after < 0.7 * before
    path = tmp_path / "model.yaml"
    found.save(path)
    again, drive = afm.load_model(path), fresh[0].drive
    assert [effect.name for effect in again.coupled.effects] == [
        "amplitude_softening",
        "maxwell_slip",
    ]
    assert np.array_equal(again.predict(drive, PERIOD), found.predict(drive, PERIOD))
    desired = found.predict(fresh[1].drive, PERIOD, periodic=True)
    drive = found.invert(desired, PERIOD, periodic=True)
    assert share(drive - fresh[1].drive, drive) < 0.02


def test_what_a_coupled_model_cannot_do_is_said(
    model: afm.Model, records: list[afm.Record]
) -> None:
    drive = records[0].drive
    far = np.cumsum(np.ones((4 * SAMPLES, 3)), axis=0) * 1e-9
    for attempt, reason in (
        (lambda: model.predict(10.0 * drive, PERIOD), "drive of [abc] is .* give a smaller drive"),
        (lambda: model.predict(drive, 2.0 * PERIOD), "identified at 0.001 s: resample drive"),
        (lambda: model.predict(drive[:, :2], PERIOD), "drive has 2 channels"),
        (lambda: model.predict(np.sign(drive), PERIOD), "drive: .* is above 390.* Hz"),
        (lambda: model.invert(far[::-1], PERIOD), "desired: no drive within its 2048 samples"),
        (lambda: model.invert(far, PERIOD, effects=["creep"]), "effects: a model of coupled axes"),
        (lambda: afm.identify(records[:3]), "3 realisations with 1 V rms, of 3 inputs: record 4"),
        (lambda: afm.identify(records, effects=["delay"]), "no effect is named 'delay'"),
        (lambda: afm.load_model().coupled, "is no model of coupled axes"),
        (lambda: model.scanner, "is a model of coupled axes, and this needs one of x and y"),
    ):
        with pytest.raises(afm.InputError, match=reason):
            attempt()


def test_limits_of_the_amplifier_are_kept(model: afm.Model) -> None:
    desired = model.predict(multisine(13, 1.0), PERIOD, periodic=True)
    with pytest.raises(
        afm.ScanError, match=r"axis [abc]: drive \[V\] = .* beyond the amplifier's 1"
    ):
        model.invert(desired, PERIOD, limits=afm.DriveLimits(1.0, 1e6), periodic=True)
    with pytest.raises(afm.ScanError, match=r"axis [abc]: slope of the drive"):
        model.invert(desired, PERIOD, limits=afm.DriveLimits(10.0, 1.0), periodic=True)


def test_a_damaged_file_is_named(model: afm.Model, tmp_path: Path) -> None:
    path = tmp_path / "model.yaml"
    model.save(path)
    text = re.sub(f"{SEAL}: .*\n", "", path.read_text("utf-8"))
    for before, after, reason in (
        ("axes:", "axis:", "unknown key 'axis'; did you mean 'axes'"),
        ("arrays_sha256: ", "arrays_sha256: 0", "these arrays are of another model"),
        ("[a, b, c]", "[a, b]", "which are not those of 2 axes"),
        ("added: []", "added: [{name: drift, kind: '', parameters: {}}]", r"added\[0\]: no effect"),
    ):
        assert before in text
        path.write_text(text.replace(before, after), "utf-8")
        with pytest.raises(afm.InputError, match=reason):
            afm.load_model(path)
