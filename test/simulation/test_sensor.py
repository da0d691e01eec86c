"""The sensor: whole quanta, the stated noise, no silent clip."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.scanner import SensorSpec, read

SPEC = SensorSpec(noise_rms=2e-9, span=100e-6, bits=16)
QUIET = SensorSpec(noise_rms=0.0, span=100e-6, bits=16)


def trace(x: Array, first_sample: int = 0) -> Trace:
    return Trace(first_sample, 1e-5, x, -x)


@settings(deadline=None)
@given(st.floats(-49e-6, 49e-6))
def test_a_quiet_reading_is_the_nearest_whole_quantum(x: float) -> None:
    reading = read(QUIET, trace(np.array([x])), np.random.default_rng(0)).x[0]
    assert abs(reading - x) <= QUIET.quantum / 2 * (1 + 1e-9)
    assert (reading / QUIET.quantum) == pytest.approx(round(reading / QUIET.quantum), abs=1e-6)


def test_noise_is_as_stated_and_unlike_in_x_and_y() -> None:
    reading = read(SPEC, trace(np.zeros(100_000)), np.random.default_rng(1))
    expected = np.hypot(SPEC.noise_rms, SPEC.quantum / np.sqrt(12.0))
    for axis in (reading.x, reading.y):
        assert axis.std() == pytest.approx(expected, rel=0.01)  # four standard errors
        assert abs(axis.mean()) < 4 * expected / np.sqrt(axis.size)
    assert abs(np.corrcoef(reading.x, reading.y)[0, 1]) < 0.015


@pytest.mark.parametrize(("sign", "axis"), [(1.0, "x"), (-1.0, "y")])
def test_saturation_is_refused_with_its_place(sign: float, axis: str) -> None:
    displacement = sign * np.array([0.0, 51e-6])
    with pytest.raises(ScanError, match=f"sample 8, axis {axis}: displacement = 5.1e-05 m"):
        read(SPEC, Trace(7, 1e-5, *_only(axis, np.abs(displacement))), np.random.default_rng(0))


def _only(axis: str, displacement: Array) -> tuple[Array, Array]:
    rest = np.zeros_like(displacement)
    return (displacement, rest) if axis == "x" else (rest, displacement)
