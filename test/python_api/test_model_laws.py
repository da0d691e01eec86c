"""Laws of a model's prediction and inverse, of one axis and of both."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

import afm_scan_ros as afm
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.model import (
    INVERSES,
    Added,
    BaseEffects,
    EffectStatus,
    InverseSettings,
    ScannerModel,
)
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.model_file import model_hash

PERIOD, SAMPLES = 5e-5, 4000
BOTH = afm.load_model()
SIZE = 8e-6
"""Peak of a motion, m: well within the range that the model was identified in."""


def alone(axis: str) -> afm.Model:
    """The model of one axis of both."""
    return afm.Model(ScannerModel(**{axis: BOTH.scanner.axis(axis)}), f"{axis} alone")


def test_an_effect_that_is_unknown_is_said_to_be(caplog: pytest.LogCaptureFixture) -> None:
    axis = BOTH.scanner.axis("x")
    effects = BaseEffects(vibration=EffectStatus("unknown", identifiable_from="frequency"))
    model = afm.Model(ScannerModel(x=evolve(axis, effects=effects)), "x without vibration")
    moved = model.predict(np.zeros(10), PERIOD)
    assert "x: vibration is unknown. Record a multisine" in caplog.text
    caplog.clear()
    model.invert(np.zeros_like(moved), PERIOD)
    assert "vibration is unknown" in caplog.text


def motion(seed: int, highest: float) -> np.ndarray:
    """Random motion (n,) in m with a band up to some Hz, from rest at zero back to it."""
    draws = np.random.default_rng(seed)
    spectrum = np.zeros(SAMPLES // 2 + 1, dtype=np.complex128)
    lines = np.arange(1, max(2, int(highest * SAMPLES * PERIOD)))
    spectrum[lines] = draws.standard_normal(len(lines)) * np.exp(
        2j * np.pi * draws.random(len(lines))
    )
    wave = np.fft.irfft(spectrum, SAMPLES) * np.sin(np.linspace(0.0, np.pi, SAMPLES)) ** 4
    return SIZE * wave / np.abs(wave).max()


bands = st.floats(10.0, 300.0)
seeds = st.integers(0, 2**32 - 1)


@given(seeds, bands, st.sampled_from(["x", "y"]))
@settings(max_examples=15)
def test_the_model_follows_its_own_inverse(seed: int, highest: float, axis: str) -> None:
    """But for what the optimal inverse gives up near its weight's corner, 5 kHz."""
    model, desired = alone(axis), motion(seed, highest)
    moved = model.predict(model.invert(desired, PERIOD), PERIOD)
    assert np.abs(moved - desired).max() < 2e-3 * SIZE


@given(seeds, bands)
@settings(max_examples=10)
def test_one_axis_does_as_the_same_axis_of_both(seed: int, highest: float) -> None:
    """No axis adds anything to the other."""
    both = np.column_stack((motion(seed, highest), motion(seed + 1, highest)))
    drives = BOTH.invert(both, PERIOD)
    moved = BOTH.predict(drives, PERIOD)
    for channel, axis in enumerate(BOTH.axes):
        drive = alone(axis).invert(both[:, channel], PERIOD)
        assert drive == pytest.approx(drives[:, channel], abs=1e-9)
        assert np.array_equal(alone(axis).predict(drives[:, channel], PERIOD), moved[:, channel])


@given(seeds, st.sets(st.integers(1, SAMPLES - 1), max_size=6))
@settings(max_examples=10)
def test_the_nodes_stream_gives_the_same_drive(seed: int, inner: set[int]) -> None:
    """The compensator inverts block by block, of any sizes."""
    both = np.column_stack((motion(seed, 200.0), motion(seed + 1, 200.0)))
    limits = afm.DriveLimits(5.0, 1e9)
    stream = Compensation(BOTH.scanner, PERIOD, INVERSES, InverseSettings(), limits)
    progress, parts = stream.at_rest(), []
    for first, last in pairwise([0, *sorted(inner), SAMPLES]):
        block = Trace(first, PERIOD, both[first:last, 0], both[first:last, 1])
        progress, drive = stream.invert(progress, block)
        parts.append(drive)
    parts.append(stream.finish(progress))
    drives = BOTH.invert(both, PERIOD, limits=limits)
    for channel, axis in enumerate(BOTH.axes):
        joined = np.concatenate([part.axis(axis) for part in parts])
        assert drives[:, channel] == pytest.approx(joined, abs=1e-9)


def test_the_shape_is_that_of_what_is_given() -> None:
    model, desired = alone("y"), motion(1, 50.0)
    assert model.invert(desired, PERIOD).shape == (SAMPLES,)
    column = model.invert(desired[:, np.newaxis], PERIOD)
    assert column.shape == (SAMPLES, 1)
    assert np.array_equal(column[:, 0], model.invert(desired, PERIOD))


def test_without_effects_each_counts_by_its_gain() -> None:
    model, desired = alone("x"), motion(2, 50.0)
    axis = model.scanner.axis("x")
    gain = axis.vibration.static_gain * axis.hysteresis.forward.chord
    assert model.invert(desired, PERIOD, effects=()) == pytest.approx(desired / gain)


def test_one_axis_is_saved_and_loaded(tmp_path: Path) -> None:
    alone("y").save(tmp_path / "y.yaml")
    loaded = afm.load_model(tmp_path / "y.yaml")
    assert (loaded.axes, loaded.origin) == (("y",), str(tmp_path / "y.yaml"))
    assert model_hash(loaded.scanner) == model_hash(alone("y").scanner)
    assert model_hash(loaded.scanner) != model_hash(BOTH.scanner)


def test_a_file_cut_before_its_second_axis_is_refused(tmp_path: Path) -> None:
    BOTH.save(tmp_path / "m.yaml")
    text = (tmp_path / "m.yaml").read_text("utf-8")
    text = "".join(line for line in text.splitlines(keepends=True) if "content_sha256" not in line)
    (tmp_path / "m.yaml").write_text(text[: text.index("\n'y':") + 1], "utf-8")
    with pytest.raises(afm.InputError, match=r"m.npz holds y_forward, y_direct, which the file"):
        afm.load_model(tmp_path / "m.yaml")


def test_a_file_without_an_axis_is_refused(tmp_path: Path) -> None:
    alone("x").save(tmp_path / "m.yaml")
    np.savez(tmp_path / "m.npz")
    text = (tmp_path / "m.yaml").read_text("utf-8")
    text = "".join(line for line in text.splitlines(keepends=True) if "sha256" not in line)
    (tmp_path / "m.yaml").write_text(text[: text.index("\nx:") + 1], "utf-8")
    with pytest.raises(afm.InputError, match=r"m.yaml: a model holds no axis"):
        afm.load_model(tmp_path / "m.yaml")


def test_a_coupling_to_an_absent_axis_is_refused(tmp_path: Path) -> None:
    coupled = evolve(BOTH.scanner.axis("x"), added=(Added("cross_coupling", "static", (0.01,)),))
    afm.Model(ScannerModel(x=coupled), "x").save(tmp_path / "m.yaml")
    with pytest.raises(afm.InputError, match=r"m.yaml: x: added: an effect couples x to the axis"):
        afm.load_model(tmp_path / "m.yaml")


def test_a_scan_that_moves_an_absent_axis_is_refused() -> None:
    """As the compensator meets it, which gets both axes."""
    x = alone("x").scanner
    inverse = Compensation(x, PERIOD, INVERSES, InverseSettings(), afm.DriveLimits(5.0, 1e6))
    still, moving = np.zeros(10), np.eye(10)[7]
    with pytest.raises(afm.ScanError, match="sample 107, axis y: the model holds no axis y"):
        inverse.invert(inverse.at_rest(), Trace(100, PERIOD, still, moving))


@pytest.mark.parametrize("first", [0.0, 5e-6])
def test_a_path_that_does_not_begin_at_rest_is_said_not_to(
    first: float, caplog: pytest.LogCaptureFixture
) -> None:
    desired = np.zeros((2000, 2))
    desired[:, 0] = first + 1e-6 * np.sin(np.linspace(0.0, 20.0, 2000)) ** 2
    afm.load_model().invert(desired, 1e-4)
    said = "desired x begins at 5e-06 m and the scanner at zero"
    assert (said in caplog.text) is (first > 0.0)
    assert "desired y" not in caplog.text
