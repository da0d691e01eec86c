"""The model discrepancy is that by which a record, computed from the model itself, was spoilt."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import excitation_block, validation_plan
from afm_scan_ros.core.identification.validation import validate_from
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array

PLAN = validation_plan()
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x


@pytest.fixture(scope="module", name="axis")
def resting_axis(axis: AxisModel) -> AxisModel:
    """Axis whose depolarised rest at 0 V is the origin of its displacement."""
    surface = axis.hysteresis.forward
    preisach = Preisach(surface)
    rest = preisach.apply(preisach.at_rest(), np.zeros(1))[1][0]
    centred = evolve(surface, offset=surface.offset - rest)
    return evolve(axis, hysteresis=evolve(axis.hysteresis, forward=centred))


@pytest.fixture(scope="module")
def record(axis: AxisModel) -> Record:
    cascade = forward(axis, PLAN.sample_period)
    return Record(DRIVE, cascade.apply(cascade.at_rest(), DRIVE)[1], PLAN.sample_period, name="own")


def validated(axis: AxisModel, record: Record, moved: Array | None = None) -> ModelDiscrepancy:
    """Error on a record, or on one of the same drive that moved otherwise (m)."""
    other = record if moved is None else evolve(record, displacement=moved)
    return validate_from(axis, other, 0).model_discrepancy


def test_a_perfect_model_has_no_model_discrepancy(axis: AxisModel, record: Record) -> None:
    found = validated(axis, record)
    assert max(found.rms) < 1e-18
    assert found.record == "own: -3.60 to 3.60 V, 12.3 s at 20000 Hz"


def test_a_wrong_gain_shows_in_every_band(axis: AxisModel, record: Record) -> None:
    found = validated(axis, record, 1.01 * record.displacement[:, 0])
    assert np.array(found.rms) / found.displacement == pytest.approx(0.01 / 1.01, rel=1e-3)


def test_noise_is_distinguished_from_the_error(axis: AxisModel, record: Record) -> None:
    noise = 2e-9 * np.random.default_rng(3).standard_normal(len(DRIVE))
    time = PLAN.sample_period * np.arange(len(DRIVE))
    added = np.where(time > 1.0, 10e-9 * np.sin(2.0 * np.pi * 60.0 * time), 0.0)
    found = validated(axis, record, record.displacement[:, 0] + noise + added)
    bands = found.bands
    assert found.noise == pytest.approx(2e-9 * np.sqrt(np.diff(bands) / bands[-1]), rel=0.03)
    expected = rms_by_band(added, bands, PLAN.sample_period)
    assert found.rms == pytest.approx(expected, abs=3e-10)


def test_a_record_that_ends_elsewhere_than_it_began_moved_no_faster(
    axis: AxisModel, record: Record
) -> None:
    """A jump from its end to its start would pass for motion where there is hardly any."""
    drifted = record.displacement[:, 0] + np.linspace(0.0, 1e-6, len(DRIVE))
    still, moved = validated(axis, record), validated(axis, record, drifted)
    fast = np.array(still.bands[:-1]) >= 290.0
    assert np.array(moved.displacement)[fast] == pytest.approx(
        np.array(still.displacement)[fast], rel=2e-3
    )
    assert max(np.array(moved.rms)[fast]) < 1e-12


def test_the_zero_of_a_sensor_is_no_error(axis: AxisModel, record: Record) -> None:
    assert max(validated(axis, record, record.displacement[:, 0] + 1e-7).rms) < 1e-18


@given(noise=st.floats(1e-10, 5e-9), seed=st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=5)
def test_without_a_rest_the_weakest_band_gives_the_noise(
    axis: AxisModel, record: Record, noise: float, seed: int
) -> None:
    """The error of the model is larger than the noise in some bands, and not in others."""
    start = int(np.argmax(DRIVE != 0.0))
    wave = 20.0 * noise * np.sin(2.0 * np.pi * 60.0 * PLAN.sample_period * np.arange(len(DRIVE)))
    added = wave + noise * np.random.default_rng(seed).standard_normal(len(DRIVE))
    noisy = evolve(record, displacement=record.displacement[:, 0] + added)
    found = validated(axis, noisy.part(start, len(DRIVE)))
    assert np.linalg.norm(found.noise) == pytest.approx(noise, rel=0.05)


def test_a_few_samples_do_not_give_the_noise(axis: AxisModel, record: Record) -> None:
    start = int(np.argmax(DRIVE != 0.0))
    found = validated(axis, record.part(start, start + 400))
    assert set(found.noise) == {0.0}
    assert found.record.endswith("which is in the rms")


def test_a_drive_beyond_the_identified_range_is_refused(axis: AxisModel, record: Record) -> None:
    beyond = evolve(record, drive=2.0 * record.drive, name="wide")
    with pytest.raises(InputError, match=r"wide record: drives -7.* keep the drive within"):
        validated(axis, beyond)
