"""Records of one axis as labs have them, given to the command as text files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from attrs import frozen
from click.testing import CliRunner, Result
from scipy.signal import cont2discrete, lfilter

import afm_scan_ros as afm
from afm_scan_ros.cli.identify import identify
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank
from helpers.fit_cases import of_bouc_wen

FAST, SLOW = 1e-4, 1e-2
RNG = 3


WIDTHS = np.array([0.1, 0.3, 0.6, 1.0, 1.6, 2.4])  # V
SLIPS = PlayBank(WIDTHS, np.full(6, 1.0 / 18.0), 0.75, 0.0, 0.0)
"""A quarter of the gain slips, the rest does not."""


def slipping(drive: Array) -> Array:
    """Slip elements of several widths, all at rest at zero."""
    return SLIPS.apply(SLIPS.relaxed(), drive)[1]


def slipping_and_bent(drive: Array) -> Array:
    force = slipping(drive)
    return np.asarray(force + 0.004 * force**3)


@frozen
class Stage:
    """Hysteresis, one resonance (Hz, damping), creep of 6 % in 5 s, a sensor of 2 nm and hum.

    The drive is late by a ``delay`` (s) of whole samples.
    """

    resonance: float = 400.0
    damping: float = 0.02
    hysteresis: Callable[[Array], Array] = slipping
    hum: float = 0.0
    delay: float = 0.0

    def moved(self, drive: Array, period: float, seed: int) -> Array:
        speed, late = 2.0 * np.pi * self.resonance, np.full(round(self.delay / period), drive[0])
        drive = np.concatenate([late, drive])[: len(drive)]
        above, below, _ = cont2discrete(
            ([speed**2], [1.0, 2.0 * self.damping * speed, speed**2]), period
        )
        rigid = 5e-6 * lfilter(above.ravel(), below, self.hysteresis(drive))
        kept = np.exp(-period / 5.0)
        slow = rigid + lfilter([0.0, 0.06 * (1.0 - kept)], [1.0, -kept], rigid)
        noise = 2e-9 * np.random.default_rng(seed).standard_normal(len(drive))
        hum = self.hum * np.sin(2.0 * np.pi * 50.06 * period * np.arange(len(drive)))
        return np.asarray(slow + hum + noise)


def ramps(levels: list[float], seconds: float) -> Array:
    time = np.arange(0.0, seconds, 2.0 * FAST)
    return np.interp(time, np.linspace(0.0, seconds, len(levels)), levels)


def waves(highest: float, period: float) -> Array:
    """Four multisines up to ``highest`` Hz, of four periods each, as converters loop them."""
    rng, length = np.random.default_rng(RNG), round(500.0 / highest / period)
    lines = np.zeros((4, length // 2 + 1), dtype=complex)
    tones = np.arange(1, int(highest * length * period) + 1)
    sizes = np.minimum(1.0, 50.0 / tones)
    lines[:, tones] = sizes * np.exp(2j * np.pi * rng.random((4, len(tones))))
    each = np.fft.irfft(lines, length)
    return np.concatenate([1.5 * np.tile(wave / np.abs(wave).max(), 4) for wave in each])


CURVES = [level for k in range(1, 9) for level in (3.6 - 0.9 * k, 3.6)]
LOOPS = [-3.6, 3.6, -1.8, 1.8, -0.9, 0.9, 0.0, 0.0]


def calibration(top: float = 1e3, *, loops: bool = True) -> dict[str, tuple[Array, float]]:
    """Drives (V) of a calibration and their sample periods (s)."""
    fast = 0.1 / top
    ends = LOOPS if loops else [0.0, 0.0]
    check = np.random.default_rng(RNG).uniform(-3.0, 3.0, 30)
    return {
        "steps": (np.repeat([0.0, 3.0, 0.0], [300, 3000, 300]), SLOW),
        "waves": (waves(top, fast), fast),
        "curves": (ramps([0.0, 0.0, 3.6, *CURVES, *ends], 16.0), 2.0 * FAST),
        "check": (ramps([0.0, *check, 0.0, 0.0], 3.0), 2.0 * FAST),
    }


def written(
    folder: Path, drives: dict[str, tuple[Array, float]], stage: Stage, seed: int = 0
) -> list[str]:
    paths = []
    for number, (name, (drive, period)) in enumerate(drives.items()):
        moved = 1e6 * stage.moved(drive, period, 10 * seed + number)
        rows = np.column_stack([period * np.arange(len(drive)), drive, moved])
        paths.append(str(folder / f"{name}.csv"))
        heading = "time [s],drive_x [V],achieved_x [um]"
        np.savetxt(paths[-1], rows, fmt="%.9g", delimiter=",", header=heading, comments="")
    return paths


def run(words: list[str], out: Path) -> Result:
    return CliRunner().invoke(identify, [*words, "--out", str(out)])


def resonance_of(path: Path) -> tuple[float, float]:
    denominator = afm.load_model(path).scanner.axis("x").vibration.denominator
    pole = max(np.roots(denominator), key=lambda p: abs(p.imag))
    return float(abs(pole)) / (2.0 * np.pi), float(-pole.real / abs(pole))


ROWS = {
    "a textbook stage": (Stage(), 1e3),
    "3 kHz and 15 nm of hum": (Stage(3000.0, hum=15e-9), 6e3),
}
"""Others identify in test/core/identification/test_any_resonance.py, without files."""


@pytest.mark.evidence
@pytest.mark.parametrize("row", ROWS)
def test_its_resonance_is_found(row: str, tmp_path: Path) -> None:
    stage, top = ROWS[row]
    *fitted, check = written(tmp_path, calibration(top), stage)
    done = run([*fitted, "--validation", check], tmp_path / "model.yaml")
    assert done.exit_code == 0, done.exception
    frequency, damping = resonance_of(tmp_path / "model.yaml")
    assert frequency == pytest.approx(stage.resonance, rel=1e-3)
    assert damping == pytest.approx(stage.damping, rel=0.03)
    assert "cut short" not in done.output
    assert ("periodic disturbance" in done.output) == (stage.hum > 0.0)


@pytest.mark.evidence
def test_curves_without_loops_want_a_validation_record_and_then_give_a_known_error(
    tmp_path: Path,
) -> None:
    *fitted, check = written(tmp_path, calibration(loops=False), Stage())
    alone = run(fitted, tmp_path / "alone.yaml")
    assert "Give a validation record" in alone.output
    found = afm.load_model(tmp_path / "alone.yaml").scanner.axis("x")
    assert all(one.fitted for one in found.model_discrepancies)
    done = run([*fitted, "--validation", check], tmp_path / "model.yaml")
    assert done.exit_code == 0, done.exception
    known = afm.load_model(tmp_path / "model.yaml").scanner.axis("x").model_discrepancy
    assert known is not None
    assert np.linalg.norm(known.rms) < 0.02 * np.linalg.norm(known.displacement)


@pytest.mark.evidence
def test_slip_elements_and_a_cubic_are_no_refusal(tmp_path: Path) -> None:
    stage, out = Stage(hysteresis=slipping_and_bent), tmp_path / "model.yaml"
    *fitted, check = written(tmp_path, calibration(), stage)
    done = run([*fitted, "--validation", check], out)
    assert done.exit_code == 0, done.exception
    known = afm.load_model(out).scanner.axis("x").model_discrepancy
    assert known is not None
    assert np.linalg.norm(known.rms) < 0.02 * np.linalg.norm(known.displacement)


@pytest.mark.evidence
def test_axes_driven_one_after_the_other_are_both_identified(tmp_path: Path) -> None:
    words = []
    for number, (name, (drive, period)) in enumerate(calibration().items()):
        still = np.zeros_like(drive)
        driven = np.concatenate([drive, still]), np.concatenate([still, drive])
        moved = [Stage().moved(each, period, 10 * number + k) for k, each in enumerate(driven)]
        time = period * np.arange(2 * len(drive))
        rows = np.column_stack([time, *driven, *(1e6 * each for each in moved)])
        path = str(tmp_path / f"{name}.csv")
        heading = "time [s],drive_x [V],drive_y [V],achieved_x [um],achieved_y [um]"
        np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=heading, comments="")
        words += ["--validation", path] if name == "check" else [path]
    done = run(words, tmp_path / "model.yaml")
    assert done.exit_code == 0, done.exception
    model = afm.load_model(tmp_path / "model.yaml")
    assert model.axes == ("x", "y")
    for effects in model.effects.values():
        assert [status.status.value for _, status in effects.each()] == ["identified"] * 3


@pytest.mark.evidence
def test_a_scanner_of_one_state_is_told_from_plays_whatever_its_start(tmp_path: Path) -> None:
    *fitted, check = written(tmp_path, calibration(), Stage(hysteresis=of_bouc_wen))
    done = run([*fitted, "--validation", check], tmp_path / "model.yaml")
    assert done.exit_code == 0, done.exception
    axis = afm.load_model(tmp_path / "model.yaml").scanner.axis("x")
    assert type(axis.hysteresis.forward).__name__ == "DuhemSlopes"
    known = axis.model_discrepancy
    assert known is not None
    assert np.linalg.norm(known.rms) < 0.015 * np.linalg.norm(known.displacement)


@pytest.mark.evidence
def test_a_delay_is_told_from_loops_and_creep(tmp_path: Path) -> None:
    """Of ten samples of the waves, and five of the others, as a control box makes it."""
    drives = {name: drive for name, drive in calibration().items() if name != "steps"}
    *fitted, check = written(tmp_path, drives, Stage(delay=1e-3))
    done = run([*fitted, "--validation", check, "--depolarised"], tmp_path / "model.yaml")
    assert done.exit_code == 0, done.exception
    found = afm.load_model(tmp_path / "model.yaml").scanner.axis("x")
    assert found.sensor is not None
    assert found.sensor.delay == pytest.approx(1e-3, abs=0.5 * FAST)
    assert f"{1e3 * found.sensor.delay:.4g} ms late" in done.output
    known = found.model_discrepancy
    assert known is not None
    assert np.linalg.norm(known.rms) < 2e-3 * np.linalg.norm(known.displacement)
