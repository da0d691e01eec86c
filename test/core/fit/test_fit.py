"""The fit of all records of an axis: what it finds, and how well it knows it."""

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.alternatives import with_one_state
from afm_scan_ros.core.fit.axis import fit_axis
from afm_scan_ros.core.fit.descent import evidence, settle
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import first_scales, layout_of
from afm_scan_ros.core.fit.plays import Plays as PlayBank
from afm_scan_ros.core.fit.simulation import simulate
from afm_scan_ros.core.fit.surfaces import everett_surface
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.fit.tones import free_tones
from afm_scan_ros.core.fit.uncertainty import covariance
from afm_scan_ros.core.identification.validation import spread_of
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import apart
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.types import Array
from helpers.fit_cases import (
    DAMPING,
    FREQUENCY,
    GAIN,
    LIMIT,
    OPERATORS,
    PERIOD,
    SETTINGS,
    displaced,
    levels,
    of_plays_alone,
    record,
    signals,
)


@pytest.fixture(scope="module")
def drive() -> Array:
    return levels(1, 14, 600)


@pytest.mark.parametrize("alike", [1e-3, 0.0])
def test_what_records_tell_no_more_than_rounding_is_as_uncertain_as_beforehand(
    alike: float,
) -> None:
    """Two columns alike in 10^12 units of the prior tell their sum, and their difference never."""
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS)
    prior, rng = np.eye(3), np.random.default_rng(6)
    rows = 1e3 * rng.standard_normal((1000, 3))
    rows[:, 1] = rows[:, 0] + alike * rows[:, 1]
    told = rows.T @ rows * (1.0 if alike else 1e6)
    found = covariance(layout, told, prior)
    difference = np.array([1.0, -1.0, 0.0])
    expected = difference @ np.linalg.inv(told + prior) @ difference if alike else 2.0
    assert difference @ found @ difference == pytest.approx(expected, rel=1e-6)
    assert np.linalg.eigvalsh(found)[0] > 0.0


def test_the_model_answers_as_the_fit_does(drive: Array) -> None:
    """Two modes, lags and creep in parallel are the model's vibration with its creep behind."""
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS, 2.0 * np.pi * FREQUENCY)
    theta = layout.start()
    for mode in ((2.0 * np.pi * FREQUENCY, DAMPING, 0.8, -0.1), (3000.0, 0.2, 0.15, 0.05)):
        layout, theta = layout.with_mode(theta, mode)
    theta[layout.parts["lags"]] += 0.03 * np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0])
    theta[layout.parts["creep"]] = 0.02
    one = signals(drive, GAIN * drive, 1)
    fit = AxisFit(layout, [one], GAIN, theta)
    (simulation,) = fit.simulated(fit.theta)
    cascade = forward(model_of(fit), PERIOD)
    of_model = cascade.apply(cascade.at_rest(), drive)[1]
    apart = of_model - GAIN * simulation.output
    assert np.abs(apart).max() < 1e-6 * np.ptp(of_model)


@pytest.mark.parametrize("bias", [-0.8, 0.3])
def test_the_model_rests_where_the_plays_do(bias: float) -> None:
    drive = 0.6 * levels(4, 6, 300)
    layout, records, gain, theta = of_plays_alone(drive, GAIN * drive)
    theta[10:70] = 0.3
    theta[layout.parts["rest"]] = bias * SETTINGS.rest_bias * LIMIT
    of_model = model_of(AxisFit(layout, records, gain, theta)).hysteresis.surface
    given, start = layout.of_operator(theta), layout.at_rest(theta)[0]
    expected = layout.operator.output(given, np.zeros(1), start)[0]
    plane = evolve(of_model, offset=everett_surface(layout.operator, given).offset)
    assert abs(expected) > 1e-3 * LIMIT
    assert Preisach(plane).at_rest().now[1] == pytest.approx(expected, abs=1e-8 * LIMIT)


def test_a_prediction_is_as_uncertain_as_its_parameters() -> None:
    """Against small parts of the responses of parameters that are drawn; the loop is unknown."""
    drive = levels(4, 6, 300)
    noise = np.random.default_rng(5).normal(0.0, 1e-8, len(drive))
    fit = AxisFit(*of_plays_alone(drive, GAIN * drive + noise))
    settle(fit, SETTINGS.most_steps, ("density",))
    fresh, known, model = 0.7 * levels(6, 3, 200), Knowledge.of(fit), model_of(fit)
    stated = np.linalg.norm(apart(model, spread_of(known, model, []), fresh, PERIOD), axis=0)
    one = signals(fresh, fresh, 1)
    rng, drawn = np.random.default_rng(6), []
    for theta in rng.multivariate_normal(fit.theta, 0.01 * known.widest, 200):
        response = simulate(fit.layout, theta, one).output
        drawn.append(fit.gain / 0.1 * (response - response[0]))
    found, room = np.std(drawn, axis=0)[100:], 0.05 * stated.max()
    np.testing.assert_allclose(found, stated[100:], rtol=0.2, atol=room)
    assert stated[0] == 0.0


def test_a_discrepancy_of_a_small_part_of_the_noise_is_none() -> None:
    drive = levels(4, 6, 300)
    noise = np.random.default_rng(5).normal(0.0, 1e-8, len(drive))
    fit = AxisFit(*of_plays_alone(drive, GAIN * drive + noise))
    (one,) = fit.records
    lost, alone = SETTINGS.lost, one.noise / np.sqrt(one.block) / one.motion
    for share, expected in ((0.9 * lost, True), (1.1 * lost, False)):
        fit.discrepancy = alone * np.sqrt(share / (1.0 - share))
        assert fit.sufficient == expected


def test_an_interval_holds_its_value_whatever_the_sign() -> None:
    """The loop of a fit may go the other way by chance; gains of creep may not be negative."""
    drive = levels(4, 6, 300)
    noise = np.random.default_rng(5).normal(0.0, 1e-8, len(drive))
    known = Knowledge.of(AxisFit(*of_plays_alone(drive, GAIN * drive + noise)))
    row = np.eye(known.fit.layout.size)[0]
    free = known.interval("opening", "V", -1.0, row)
    bounded = known.interval("gain", "1", 1e-9, row, 0.0)
    assert free.lower is not None
    assert free.upper is not None
    assert free.lower < -1.0 < free.upper
    assert bounded.lower == 0.0


def test_a_record_too_short_for_hum_takes_it_from_another() -> None:
    rng = np.random.default_rng(6)
    long, short = levels(4, 20, 3000), levels(5, 20, 150)
    given = []
    for drive in (long, short):
        hum = 5e-9 * np.sin(2.0 * np.pi * 50.02 * PERIOD * np.arange(len(drive)) + 0.7)
        before = np.concatenate([[0.0], drive[:-1]])  # the input is held between samples
        given.append(GAIN * before + hum + 2e-9 * rng.standard_normal(len(drive)))
    layout, first, _, theta = of_plays_alone(long, given[0])
    both = [*first, signals(short, given[1], 1)]
    assert PERIOD * len(short) * 50.02 < SETTINGS.tone_cycles
    fit = AxisFit(layout, both, GAIN, theta)
    fit.weigh()
    assert free_tones(fit)
    assert [one.tones for one in fit.records] == [pytest.approx([50.02], abs=0.03)] * 2
    assert not free_tones(fit)
    assert [one.tones for one in fit.records] == [pytest.approx([50.02], abs=0.03)] * 2


def test_the_evidence_is_the_marginal_likelihood_of_a_linear_model() -> None:
    """Between two scales of the prior it differs as the normal densities of the data do."""
    rng = np.random.default_rng(2)
    layout = layout_of(PlayBank(-LIMIT, LIMIT), 1.0, PERIOD, SETTINGS)
    theta, count = layout.start(), 30
    columns = rng.standard_normal((count, layout.size))
    data = columns @ theta + rng.standard_normal(count)
    values, exact = [], []
    for size in (0.01, 0.1):
        scales = {**first_scales(SETTINGS), "correction": size}
        right = columns.T @ (data - columns @ theta)
        values.append(evidence(layout, scales, theta, columns.T @ columns, right))
        precision, mean = layout.prior(scales, theta)
        precision += 1e-9 * np.eye(len(precision))
        covariance = np.eye(count) + columns @ np.linalg.solve(precision, columns.T)
        missed = data - columns @ mean
        volume = np.linalg.slogdet(covariance)[1]
        exact.append(-0.5 * (missed @ np.linalg.solve(covariance, missed) + volume))
    assert values[1] - values[0] == pytest.approx(exact[1] - exact[0], rel=1e-3)


OVERCONFIDENT = {"plays": 3.0, "duhem": 3.0, "bouc_wen": 8.0}
"""Largest error over its stated standard deviation: the page says that it is too small."""


@pytest.mark.evidence
@pytest.mark.parametrize("family", OPERATORS)
def test_a_few_seconds_of_levels_identify_a_scanner(family: str) -> None:
    """These levels do, to 0.1 % of a fresh drive's range; the docs have others."""
    operator = OPERATORS[family]
    fit = fit_axis([record(operator, levels(11, 60, 1500), tone=5e-9)], "x")
    model = model_of(fit)
    fresh = 0.9 * levels(23, 12, 1500)
    true = displaced(operator, fresh)
    cascade = forward(model, PERIOD)
    found = cascade.apply(cascade.at_rest(), fresh)[1]
    assert np.std(found - true) < 1e-3 * np.ptp(true)
    slope = np.polyfit(true, found, 1)[0]
    assert abs(slope - 1.0) < 2e-3
    assert isinstance(fit.layout.operator, PlayBank if family == "plays" else OneState)
    assert fit.records[0].tones == pytest.approx([50.02], abs=0.02)
    omega, damping, *_ = fit.layout.of_modes(fit.theta)[0]
    assert omega / (2.0 * np.pi) == pytest.approx(FREQUENCY, rel=1e-3)
    assert damping == pytest.approx(DAMPING, rel=0.05)
    assert fit.records[0].noise == pytest.approx(0.2e-9, rel=0.1)
    spread = spread_of(Knowledge.of(fit), model, [])
    known = afm.Model(ScannerModel(x=evolve(model, spread=spread)), "a fit")
    _, stated = known.predict(fresh, PERIOD, return_std=True)
    ratio = np.std(found - true) / np.sqrt(np.mean(stated**2))
    assert 0.2 < ratio < OVERCONFIDENT[family]


def test_no_record_that_moves_is_refused() -> None:
    still = afm.Record(np.zeros(1000), np.zeros(1000), PERIOD)
    with pytest.raises(InputError, match="no record moves x: give one whose drive changes"):
        fit_axis([still], "x")


@pytest.mark.evidence
def test_the_fit_does_not_depend_on_the_order_of_records() -> None:
    halves = [record(OPERATORS["plays"], levels(seed, 20, 1000)) for seed in (3, 4)]
    one, two = (fit_axis(list(order), "x") for order in (halves, halves[::-1]))
    assert isinstance(one, AxisFit)
    fresh = 0.8 * levels(23, 12, 1500)
    paths = []
    for fit in (one, two):
        cascade = forward(model_of(fit), PERIOD)
        paths.append(cascade.apply(cascade.at_rest(), fresh)[1])
    assert np.std(paths[0] - paths[1]) < 2e-4 * np.ptp(paths[0])
    assert with_one_state(one).layout.operator.bends == 0
