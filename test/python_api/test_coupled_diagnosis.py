"""The effects that a model of three coupled axes lacks, of a structure stepped in time."""

import json
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from click.testing import CliRunner

import afm_scan_ros as afm
from afm_scan_ros.cli.recorded import diagnose as command

PERIOD, SAMPLES, LINES, FINER = 1e-3, 512, 200, 10
AXES = ("a", "b", "c")
SHAPES = np.array([[1.0, 0.4, -0.3], [-0.5, 1.0, 0.2], [0.3, -0.2, 1.0]])
NATURAL = 2.0 * np.pi * np.array([90.0, 130.0, 210.0])
DAMPING = np.array([0.03, 0.02, 0.015])
SETTLING, STATES, NOISE = 6, 6, 30e-9
SMALL, LARGER = 0.5, (1.0, 2.0)
"""Rms drives, V: of the model, and of the records that are diagnosed."""

Stiffness = Callable[[np.ndarray], np.ndarray]
"""Force of the springs for modal displacements (records, 3)."""


def multisine(seed: int, rms: float) -> np.ndarray:
    spectrum = np.zeros((SAMPLES // 2 + 1, 3), dtype=complex)
    rng = np.random.default_rng(seed)
    spectrum[1 : LINES + 1] = np.exp(2j * np.pi * rng.random((LINES, 3)))
    drive = np.fft.irfft(spectrum, SAMPLES, axis=0)
    return rms * drive / drive.std()


def moved(drives: np.ndarray, softness: float, spring: Stiffness) -> np.ndarray:
    """Displacement (m) of three modes; drives and displacement (samples, records, 3).

    ``softness`` lowers each mode's stiffness with the logarithm of its rms over the last period.
    """
    at, speed = np.zeros((2, *drives.shape[1:]))
    power = np.full_like(at, drives.var())
    result, step = np.empty_like(drives), PERIOD / FINER
    for k, volts in enumerate(drives @ SHAPES):
        result[k] = 1e-6 * at @ SHAPES.T
        power = power + (at**2 - power) / SAMPLES
        level = 0.5 * np.log(power)
        for _ in range(FINER):
            force = volts - spring(at) + softness * level * at
            speed = speed + step * (NATURAL**2 * force - 2.0 * DAMPING * NATURAL * speed)
            at = at + step * speed
    return result


def recorded(
    seeds: Sequence[int], rms: float, softness: float = 0.0, spring: Stiffness = np.asarray
) -> list[afm.Record]:
    """Two steady periods of each realisation, with noise."""
    once = np.stack([multisine(seed, rms) for seed in seeds], axis=1)
    drive = np.tile(once, (SETTLING + 2, 1, 1))
    found = moved(drive, softness, spring)
    found = found + NOISE * np.random.default_rng(seeds[0]).standard_normal(found.shape)
    steady = slice(SETTLING * SAMPLES, None)
    return [
        afm.Record(drive[steady, k], found[steady, k], PERIOD, AXES, name=f"{rms} V, {seed}")
        for k, seed in enumerate(seeds)
    ]


def stiffened(at: np.ndarray) -> np.ndarray:
    """Springs beside the actuators, whose elongations are at @ inv(SHAPES)."""
    return at + 2e-4 * (at @ np.linalg.inv(SHAPES)) ** 3 @ SHAPES


def stiffened_modes(at: np.ndarray) -> np.ndarray:
    """Springs elsewhere in the structure, which the catalogue does not describe."""
    return at + 1e-4 * at**3


def softened(at: np.ndarray) -> np.ndarray:
    return 0.99 * at


@cache
def small(softness: float, spring: Stiffness) -> tuple[list[afm.Record], afm.Model]:
    """Records of the small amplitude, and the model that they give."""
    records = recorded(range(5), SMALL, softness, spring)
    return records, afm.identify(records, states=STATES)


CASES: dict[str, tuple[float, Stiffness, Stiffness, str, tuple[str, ...]]] = {
    "none": (0.0, np.asarray, np.asarray, "model_sufficient", ()),
    "softening": (0.02, np.asarray, np.asarray, "effect_found", ("amplitude_softening",)),
    "cubic": (0.0, stiffened, stiffened, "effect_found", ("static_nonlinearity",)),
    "cubic modes": (0.0, stiffened_modes, stiffened_modes, "unexplained", ()),
    "changed": (0.0, np.asarray, softened, "effect_found", ("parameter_shift",)),
}
"""Softness, spring before and after the model was identified, verdict and effects."""


def larger(case: str) -> list[afm.Record]:
    """Five realisations of each of the larger amplitudes."""
    softness, _, after, _, _ = CASES[case]
    return [
        record
        for k, rms in enumerate(LARGER)
        for record in recorded(range(100 + 10 * k, 105 + 10 * k), rms, softness, after)
    ]


@cache
def diagnosed(case: str) -> afm.Diagnosis:
    softness, before, *_ = CASES[case]
    records, model = small(softness, before)
    return afm.diagnose(model, larger(case), healthy=records)


LONG = ("cubic", "cubic modes", "changed")


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.evidence] * (case in LONG)) for case in CASES]
)
def test_what_a_structure_has_is_found(case: str) -> None:
    *_, verdict, names = CASES[case]
    found = diagnosed(case)
    assert (found.verdict, tuple(effect.name for effect in found.effects)) == (verdict, names)
    assert sum(found.probabilities["all"].values()) == pytest.approx(1.0)
    assert (found.next_experiment is None) == (verdict not in ("ambiguous", "unexplained"))


def test_the_extended_model_holds_at_all_amplitudes(tmp_path: Path) -> None:
    found = diagnosed("softening")
    found.save(tmp_path)
    written = json.loads((tmp_path / "diagnosis.json").read_text("utf-8"))
    extended = afm.load_model(tmp_path / "model.extended.yaml")
    assert written["verdict"] == found.verdict
    assert {e["name"] for e in written["effects"]} == {e.name for e in found.effects}
    assert "softening" in (tmp_path / "report.html").read_text("utf-8")
    for axis in AXES:
        assert written["residual_rms_after_m"][axis] < 0.2 * written["residual_rms_before_m"][axis]
    assert len(extended.coupled.errors) == 1 + len(LARGER)
    (fresh,) = recorded([50], LARGER[-1], CASES["softening"][0])
    left = extended.predict(fresh.drive, PERIOD, periodic=True) - fresh.displacement
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(fresh.displacement)


def test_the_command_diagnoses_text_files(tmp_path: Path) -> None:
    _, model = small(*CASES["none"][:2])
    model.save(tmp_path / "model.yaml")
    names = [f"{what}_{a} [{u}]" for what, u in (("drive", "V"), ("achieved", "um")) for a in AXES]
    paths = []
    for number, record in enumerate(larger("none")):
        paths.append(str(tmp_path / f"{number}.csv"))
        rows = np.column_stack([record.drive, 1e6 * record.displacement])
        np.savetxt(paths[-1], rows, "%.9g", ",", header=",".join(names), comments="")
    out = tmp_path / "found"
    words = [*paths, "--sample-rate", "1kHz", "--model", str(tmp_path / "model.yaml")]
    done = CliRunner().invoke(command, [*words, "--out", str(out)], catch_exceptions=False)
    assert done.exit_code == 0
    assert "The model is sufficient" in done.output
    assert json.loads((out / "diagnosis.json").read_text("utf-8"))["verdict"] == "model_sufficient"


def test_records_that_tell_nothing_are_refused() -> None:
    records, model = small(*CASES["none"][:2])
    first = records[0]
    other = evolve(first, axes=("a", "c", "b"))
    slower = evolve(first, sample_period=2.0 * PERIOD)
    for given, says in (
        ([], "no record is given"),
        ([other], "its axes are a, c, b, and those of the model a, b, c"),
        ([slower], "its sample period is 0.002 s, and that of the model 0.001 s"),
        (records[:3], "3 realisations with 0.5 V rms, of 3 inputs: record 4"),
        ([*records, first], "holds the same as .*, which would count twice"),
    ):
        with pytest.raises(afm.InputError, match=says):
            afm.diagnose(model, given)
