"""The sensor's low-pass: Butterworth's response, predicted and never inverted."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import default_model

ORDERS = st.sampled_from([2, 4, 6, 8])
CORNERS = st.floats(1.0, 1e5)


@given(ORDERS, CORNERS, st.floats(0.01, 100.0))
def test_it_passes_as_butterworth_says(order: int, corner: float, share: float) -> None:
    """|M(jω)|² = 1 / (1 + (ω/ω_c)^2n): S. Butterworth, 1930, and every textbook."""
    sensor, s = SensorModel(order, corner), 2j * np.pi * corner * share
    terms = zip(sensor.weights, sensor.poles, strict=True)
    found = sum(
        0.5 * (k / (1.0 - s / p) + k.conjugate() / (1.0 - s / p.conjugate())) for k, p in terms
    )
    assert abs(found) ** 2 == pytest.approx(1.0 / (1.0 + share ** (2 * order)), rel=1e-6, abs=1e-9)


@given(ORDERS, CORNERS)
def test_a_vibration_is_read_as_the_product_of_both(order: int, corner: float) -> None:
    sensor, lag = SensorModel(order, corner), VibrationModel((3e-6,), (1.0 / corner, 1.0))
    omega = 2.0 * np.pi * corner * np.geomspace(0.01, 3.0, 20)
    poles = [*sensor.poles, *sensor.poles.conj()]
    low_pass = np.prod([1.0 / (1.0 - 1j * omega / p) for p in poles], axis=0)
    np.testing.assert_allclose(
        sensor.read(lag).response(omega), low_pass * lag.response(omega), rtol=1e-6
    )


def test_it_changes_what_is_predicted_and_not_the_inverse() -> None:
    axis, period = default_model().axis("x"), 2e-5
    read = evolve(axis, sensor=SensorModel(2, 400.0))
    target = 1e-6 * np.sin(2.0 * np.pi * 20.0 * period * np.arange(5000)) ** 2
    drives, moved = [], []
    for model in (axis, read):
        chain = chain_of(model)
        inverse = chain.compensator(period, ("creep", "hysteresis"), InverseSettings())
        drives.append(inverse.invert(inverse.inverse_at_rest(), target)[1])
        forward = chain.forward(period)
        moved.append(forward.apply(forward.at_rest(), drives[0])[1])
    np.testing.assert_array_equal(*drives)
    late = np.sqrt(2.0) / (2.0 * np.pi * 400.0)  # of slow motion
    expected = np.interp(period * np.arange(5000) - late, period * np.arange(5000), moved[0])
    assert np.std(moved[1] - expected) < 1e-3 * np.std(moved[0])


@given(st.floats(0.0, 1.0))
def test_it_reads_late_by_its_delay(delay: float) -> None:
    lag, omega = VibrationModel((3e-6,), (0.1, 1.0)), np.geomspace(0.1, 100.0, 20)
    found = SensorModel(delay=delay).read(lag).response(omega)
    np.testing.assert_allclose(found, np.exp(-1j * omega * delay) * lag.response(omega))


def test_a_negative_delay_is_refused() -> None:
    with pytest.raises(InputError, match="delay is -1e-06 s"):
        SensorModel(delay=-1e-6)


@pytest.mark.parametrize(
    ("order", "corner"), [(1, 100.0), (3, 100.0), (0, 100.0), (2, 0.0), (2, np.inf)]
)
def test_an_odd_order_or_no_corner_is_refused(order: int, corner: float) -> None:
    with pytest.raises(InputError, match="even order and a positive corner"):
        SensorModel(order, corner)
