"""Hum is found and taken off whatever the drive; what the drive does is not taken for hum."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.identification.drives.waveforms import Multisine, whole
from afm_scan_ros.core.identification.records.hum import hum, without_hum
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank

RATE = 5e3
TIME = np.arange(50_000) / RATE
NOISE = np.random.default_rng(1).standard_normal(len(TIME))
LOW, HIGH = 50.06, 3.0 * 50.06


def multisine() -> Array:
    rng = np.random.default_rng(3)
    spectrum = np.zeros((4, 1251), dtype=np.complex128)
    spectrum[:, 2:500] = np.exp(2j * np.pi * rng.random((4, 498)))
    waves = np.fft.irfft(spectrum, 2500)
    return whole(Multisine(1.0 / RATE, waves / np.abs(waves).max(), 5))


DRIVES = {
    "rest": np.zeros(30_000),
    "multisine": multisine(),
    "sweep": signal.chirp(TIME, 1.0, TIME[-1], 1000.0, "log"),
    "noise": signal.lfilter(*signal.butter(4, 0.3), NOISE),
    "steps": np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, 40), 1000),
}


def moved(drive: Array) -> Array:
    """A resonance at 300 Hz behind a little hysteresis, 1 µm/V, with 2 nm of noise, m."""
    omega = 2.0 * np.pi * 300.0
    plays = PlayBank(np.linspace(1e-3, 2.0, 100), np.full(100, 1e-3), 1.0, 0.0, 0.0)
    b, a, _ = signal.cont2discrete(([omega**2], [1.0, 0.04 * omega, omega**2]), 1.0 / RATE)
    clean = signal.lfilter(b[0], a, plays.apply(plays.relaxed(), drive)[1])
    return 1e-6 * clean + 2e-9 * np.random.default_rng(4).standard_normal(len(drive))


def disturbance(samples: int) -> Array:
    time = np.arange(samples) / RATE
    low = 15e-9 * np.sin(2.0 * np.pi * LOW * time + 0.3)
    return np.asarray(low + 4e-9 * np.cos(2.0 * np.pi * HIGH * time))


@pytest.mark.parametrize("kind", DRIVES)
def test_hum_is_found_and_taken_off(kind: str) -> None:
    drive = DRIVES[kind]
    clean, added = moved(drive), disturbance(len(drive))
    quiet, found = without_hum(drive, clean + added, 1.0 / RATE)
    first = found[0]
    assert first.frequency == pytest.approx(LOW, abs=0.1 * RATE / len(drive))
    assert first.amplitude == pytest.approx(15e-9, rel=0.05)
    assert len(found) <= 2
    assert np.std(quiet - clean) < (1e-9 if len(found) == 2 else 3.5e-9)


@pytest.mark.parametrize("kind", DRIVES)
def test_without_hum_none_is_found(kind: str) -> None:
    assert hum(DRIVES[kind], moved(DRIVES[kind]), 1.0 / RATE) == ()


def test_a_mode_that_the_room_rings_is_no_hum() -> None:
    pole = 0.999 * np.exp(2j * np.pi * 120.0 / RATE)
    ringing = signal.lfilter([1.0], np.poly([pole, pole.conj()]).real, NOISE)
    assert hum(np.zeros(len(TIME)), 1e-9 * ringing, 1.0 / RATE) == ()


def creeping() -> tuple[Array, Array]:
    """Triangles of 20 Hz between rests, and how a scanner that creeps follows them, m."""
    once = 1.0 - np.abs(np.linspace(-1.0, 1.0, 250, endpoint=False))
    drive = np.concatenate([np.zeros(1500), np.tile(50.0 * once, 20), np.zeros(1500)])
    kept = np.exp(-1.0 / (0.3 * RATE))
    return drive, 2e-7 * drive + signal.lfilter([0.0, 4e-9 * (1.0 - kept)], [1.0, -kept], drive)


def test_what_creeps_from_period_to_period_is_no_hum() -> None:
    drive, clean = creeping()
    clean = clean + 2e-9 * np.random.default_rng(5).standard_normal(len(drive))
    assert hum(drive, clean, 1.0 / RATE) == ()
    (found,) = hum(drive, clean + disturbance(len(drive)), 1.0 / RATE)[:1]
    assert found.frequency == pytest.approx(LOW, abs=0.1)
    assert found.amplitude == pytest.approx(15e-9, rel=0.1)
