"""``afm-scan identify`` of text files in which several axes are driven at once."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.signal import cont2discrete, lfilter

import afm_scan_ros as afm
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.identification import of_coupled_axes

PERIOD, SAMPLES, LINES = 5e-4, 512, 150
RESONANCES = (110.0, 160.0, 230.0)
MIXED = np.array([[1.0, 0.3, -0.2], [-0.2, 1.0, 0.1], [0.1, -0.3, 1.0]])
NAMES = ("x", "y", "z")


def realisation(seed: int, axes: int) -> np.ndarray:
    lines = np.zeros((SAMPLES // 2 + 1, axes), dtype=complex)
    lines[1 : LINES + 1] = np.exp(2j * np.pi * np.random.default_rng(seed).random((LINES, axes)))
    wave = np.fft.irfft(lines, SAMPLES, axis=0)
    return np.asarray(wave / wave.std())


def followed(drive: np.ndarray, mixed: np.ndarray) -> np.ndarray:
    """Displacement (m) of modes that each drive excites, continuous and behind a hold."""
    moved = np.empty_like(drive)
    for k, frequency in enumerate(RESONANCES[: drive.shape[1]]):
        speed = 2.0 * np.pi * frequency
        above, below, _ = cont2discrete(([speed**2], [1.0, 0.06 * speed, speed**2]), PERIOD)
        moved[:, k] = lfilter(above.ravel(), below, drive @ mixed[k])
    return 1e-6 * moved @ mixed


def tables(folder: Path, mixed: np.ndarray) -> list[str]:
    """Two steady periods of each of several realisations, as text files."""
    axes, paths = len(mixed), []
    for seed in range(axes + 2):
        drive = np.tile(realisation(seed, axes), (12, 1))
        moved = followed(drive, mixed)
        moved += 1e-9 * np.random.default_rng(100 + seed).standard_normal(moved.shape)
        last = np.column_stack([drive, 1e6 * moved])[-2 * SAMPLES :]
        time = PERIOD * np.arange(len(last))
        names = [
            f"{what}_{n} [{u}]"
            for what, u in (("drive", "V"), ("achieved", "um"))
            for n in NAMES[:axes]
        ]
        paths.append(str(folder / f"{seed}.csv"))
        heading = ",".join(["time [s]", *names])
        rows = np.column_stack([time, last])
        np.savetxt(paths[-1], rows, fmt="%.9g", delimiter=",", header=heading, comments="")
    return paths


@pytest.mark.parametrize("axes", [2, 3])
def test_coupled_axes_of_text_files_give_their_model(axes: int, tmp_path: Path) -> None:
    mixed, out = MIXED[:axes, :axes], tmp_path / "model.yaml"
    words = [*tables(tmp_path, mixed), "--states", str(2 * axes), "--out", str(out)]
    done = CliRunner().invoke(identify, words, catch_exceptions=False)
    assert f"{', '.join(NAMES[:axes])}: coupled vibration, {2 * axes} states" in done.output
    model = afm.load_model(out)
    fresh = np.tile(realisation(50, axes), (12, 1))
    expected, found = followed(fresh, mixed), model.predict(fresh, PERIOD)
    assert np.linalg.norm(found - expected) < 0.01 * np.linalg.norm(expected)


def test_two_axes_are_coupled_where_their_records_show_it(tmp_path: Path) -> None:
    records = [afm.read_record(path) for path in tables(tmp_path, MIXED[:2, :2])]
    model = afm.identify(records)
    assert model.is_coupled
    assert model.axes == ("x", "y")
    assert model.coupled.relative_error < 0.01


def test_two_axes_are_not_coupled_where_each_follows_its_own_drive(tmp_path: Path) -> None:
    records = [afm.read_record(path) for path in tables(tmp_path, np.eye(2))]
    assert not of_coupled_axes(records)
    assert not of_coupled_axes(records[:2])
