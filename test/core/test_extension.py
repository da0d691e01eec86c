"""Predictions beyond the identified range, and their standard deviation."""

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st

import afm_scan_ros as afm
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.model import AxisModel, HysteresisOperator, ScannerModel, effect_of
from afm_scan_ros.core.prediction import SHARE, extended_axis, unknown_beyond
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Array, channels_of
from helpers.in_process import ALL, default_model, scan

PERIOD, KINDS = 1e-4, ("surface", "one state")


def slopes() -> DuhemSlopes:
    """An operator of one state whose loops open to one side."""
    table = 1.0 + 0.1 * np.random.default_rng(2).random((2, 7, 6))
    return DuhemSlopes(-4.0, 4.0, -4.2, 0.0, (-1.0, 1.0), np.full(7, 1.05), *table)


def model(kind: str) -> AxisModel:
    axis = default_model().axis("x")
    if kind == "one state":
        return evolve(axis, hysteresis=evolve(axis.hysteresis, forward=slopes()))
    surface = evolve(axis.hysteresis.forward, bias=0.02)
    return evolve(axis, hysteresis=evolve(axis.hysteresis, forward=surface))


def output(operator: HysteresisOperator, drive: Array) -> Array:
    effect = effect_of(operator)
    return np.asarray(effect.apply(effect.at_rest(), drive)[1])


@pytest.mark.parametrize("kind", KINDS)
@given(seed=st.integers(0, 1000))
def test_nothing_changes_within_the_range(kind: str, seed: int) -> None:
    given_model = model(kind)
    wider = extended_axis(given_model, np.array([4.0 * (1.0 + SHARE)]))
    corners = np.random.default_rng(seed).uniform(-4.0, 4.0, 12)
    drive = np.interp(np.linspace(0, 12, 600), np.arange(13), [0.0, *corners])
    inner, outer = (output(one.hysteresis.forward, drive) for one in (given_model, wider))
    np.testing.assert_allclose(outer, inner, atol=1e-3 * np.ptp(inner))


@pytest.mark.parametrize("kind", KINDS)
def test_branches_go_on_with_the_slope_at_the_end(kind: str) -> None:
    wider = extended_axis(model(kind), np.array([4.4]))
    for end in (1.0, -1.0):
        drive = end * np.linspace(0.0, 4.4, 881)
        slope = np.diff(output(wider.hysteresis.forward, drive)) / np.diff(drive)
        assert slope[-1] == pytest.approx(slope[795], rel=0.03)


def test_a_drive_within_the_range_needs_no_wider_model() -> None:
    axis = model("surface")
    assert extended_axis(axis, np.array([-4.0, 4.0])) is axis
    assert not unknown_beyond(axis, np.array([-4.0, 4.0])).any()


def test_beyond_the_range_the_deviation_grows_and_a_farther_drive_is_refused() -> None:
    wave = np.zeros((4000, 2))
    wave[:, 0] = np.sin(np.linspace(0.0, 2.0 * np.pi, 4000))
    given_model = afm.load_model()
    with pytest.raises(afm.InputError, match="identified to 4 V"):
        given_model.predict(4.2 * wave, PERIOD)
    with pytest.raises(afm.InputError, match="10% more"):
        given_model.predict(4.5 * wave, PERIOD, beyond="extend")
    _, within = given_model.predict(4.0 * wave, PERIOD, beyond="extend", return_std=True)
    moved, beyond = given_model.predict(4.2 * wave, PERIOD, beyond="extend", return_std=True)
    assert np.ptp(within[:, 0]) == 0.0
    assert beyond[1000, 0] > beyond[0, 0] > 0.0
    assert beyond[1000, 0] < 0.05 * np.ptp(moved[:, 0])


@pytest.mark.parametrize(("rate", "size"), [(1.0, 40e-6), (5.0, 20e-6), (100.0, 10e-6)])
def test_the_deviation_is_about_the_true_error(rate: float, size: float) -> None:
    """Of scans of the simulated scanner, whose records of them the model has not seen.

    A wide preparation sets what it does not state: where the scanner rests, which is 50 nm off.
    """
    prepared = ScanSpec(preparation_lower=-28e-6, preparation_upper=25e-6)
    done = scan(evolve(prepared, line_rate=rate, lines=6, range_x=size, range_y=size), ALL)
    drive, true = (channels_of(one, ("x", "y")) for one in (done.drive, done.true))
    moved, std = afm.load_model().predict(drive, done.spec.sample_period, return_std=True)
    ratio = np.sqrt(np.mean((moved - true) ** 2, axis=0)) / std[0]
    assert (ratio > 1.0 / 2.5).all()
    assert (ratio < 1.3).all()


def test_a_model_that_states_no_error_has_no_deviation() -> None:
    axis = evolve(default_model().axis("x"), model_discrepancy=None, known_elsewhere=())
    silent = afm.Model(ScannerModel(x=axis), "a test")
    with pytest.raises(afm.InputError, match="states no error"):
        silent.predict(np.zeros(100), PERIOD, return_std=True)
    with pytest.raises(afm.InputError, match="give refuse, extend or a number"):
        silent.predict(np.zeros(100), PERIOD, beyond="clip")
    for number in (0.0, -0.1, np.nan):
        with pytest.raises(afm.InputError, match="give a positive number"):
            silent.predict(np.zeros(100), PERIOD, beyond=number)


@pytest.mark.parametrize("kind", KINDS)
def test_a_prediction_goes_as_far_as_is_asked(kind: str) -> None:
    """The farther it is from what was identified, the less is known of it."""
    given_model = afm.Model(ScannerModel(x=model(kind)), "a test")
    wave = np.sin(np.linspace(0.0, 2.0 * np.pi, 2000))
    with pytest.raises(afm.InputError, match="50% more may be predicted"):
        given_model.predict(6.2 * wave, PERIOD, beyond=0.5)
    moved, std = given_model.predict(5.9 * wave, PERIOD, beyond=0.5, return_std=True)
    nearer, known = given_model.predict(4.3 * wave, PERIOD, beyond=0.5, return_std=True)
    assert np.isfinite(moved).all()
    assert np.ptp(moved) > 1.2 * np.ptp(nearer)
    assert std.max() > known.max()
