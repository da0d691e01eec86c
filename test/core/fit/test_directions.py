"""The covariance of a fit by few directions: how much of it they hold, and what it follows."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of, principal, scans, variant_of, variants
from afm_scan_ros.core.fit.parameters import SEARCHED
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.validation import spread_of
from afm_scan_ros.core.model import Status
from afm_scan_ros.core.prediction import apart
from afm_scan_ros.core.types import Array
from helpers.fit_cases import GAIN, PERIOD, SETTINGS, levels, of_plays_alone, signals

FRESH = 0.7 * levels(6, 3, 200)


def fitted(*seeds: int) -> AxisFit:
    """Return a fit at the true parameters of a scanner without hysteresis."""
    records, drive = [], levels(4, 6, 300)
    for seed in seeds:
        noise = np.random.default_rng(seed).normal(0.0, 1e-8, len(drive))
        before = np.concatenate([[0.0], drive[:-1]])  # the input is held between samples
        records.append(signals(drive, GAIN * before + noise, 1))
    layout, _, gain, theta = of_plays_alone(records[0].drive, records[0].displacement)
    fit = AxisFit(layout, records, gain, theta)
    fit.weigh()
    return fit


def stated(fit: AxisFit) -> Array:
    """Standard deviation (m) of a fresh motion by the parameters alone."""
    model, known = model_of(fit), Knowledge.of(fit)
    return np.linalg.norm(apart(model, spread_of(known, model, []), FRESH, PERIOD), axis=0)


def test_more_records_leave_less_unknown() -> None:
    """Of twice as many records alike, by a factor of the root of two at most."""
    one, two, four = (
        float(np.linalg.norm(stated(fitted(*seeds)))) for seeds in ((4,), (4, 5), (4, 5, 7, 8))
    )
    assert 0.6 * one < two < 0.95 * one
    assert 0.6 * two < four < 0.95 * two


def test_hysteresis_that_no_record_tells_is_as_uncertain_as_beforehand() -> None:
    drive = np.repeat([0.0, 0.5, 1.0, 0.4], 500)
    noise = np.random.default_rng(4).normal(0.0, 1e-8, len(drive))
    layout, records, gain, theta = of_plays_alone(drive, GAIN * np.append(0.0, drive[:-1]) + noise)
    fit = AxisFit(layout, records, gain, theta, scales=dict.fromkeys(SEARCHED, 0.001))
    fit.weigh()
    known, model = Knowledge.of(fit), model_of(fit)
    assert known.effects().hysteresis.status is Status.UNKNOWN
    of_model = spread_of(known, model, [])
    moved = np.linalg.norm(apart(model, of_model, FRESH, PERIOD))
    own = evolve(of_model, directions=variants(fit, known.posterior, known.every)[1])
    assert moved > 3.0 * np.linalg.norm(apart(model, own, FRESH, PERIOD))


def test_all_directions_are_the_covariance() -> None:
    fit, rng = fitted(4), np.random.default_rng(1)
    size = fit.layout.size
    half, rows = rng.standard_normal((size, size)), rng.standard_normal((3 * size, size))
    settings = evolve(SETTINGS, spread_directions=size, spread_left=0.0)
    fit.layout = evolve(fit.layout, settings=settings)
    moves = principal(fit, half @ half.T, [rows.T @ rows])
    np.testing.assert_allclose(moves.T @ moves, half @ half.T, rtol=1e-6, atol=1e-6 * size)


@pytest.mark.parametrize("count", [1, 3, 12])
def test_few_directions_leave_the_variance_of_predictions_as_it_is(count: int) -> None:
    fit, rng = fitted(4), np.random.default_rng(2)
    size = fit.layout.size
    half, rows = rng.standard_normal((size, size)), rng.standard_normal((50, size))
    fit.layout = evolve(fit.layout, settings=evolve(SETTINGS, spread_directions=count))
    moves = principal(fit, half @ half.T, [rows.T @ rows])
    assert len(moves) == count
    whole = np.sum((rows @ half) ** 2)
    assert np.sum((rows @ moves.T) ** 2) == pytest.approx(whole, rel=1e-6)


def test_a_variant_rests_at_zero_and_is_shorter_where_it_would_have_no_inverse() -> None:
    fit = fitted(4)
    move = np.zeros(fit.layout.size)
    move[[0, 40]] = 1.5, -400.0  # the slope of the drive itself, which is 1, and a play's density
    centre = variant_of(fit, 0.0 * move, 0.0)
    assert np.mean(centre.forward.values) > 0.0
    _, (shorter,) = variants(fit, np.outer(move, move), [np.eye(len(move))])
    assert 0.0 < shorter.deviations < 1.0
    for one in (centre, shorter):
        assert Preisach(one.forward).at_rest().now[1] == pytest.approx(0.0, abs=1e-9)
    longer = variant_of(fit, move, 1e-3).forward.values - centre.forward.values
    change = (shorter.forward.values - centre.forward.values) / shorter.deviations
    np.testing.assert_allclose(np.abs(change), np.abs(longer) / 1e-3, rtol=1e-6, atol=1e-9)


def test_the_scans_begin_at_rest_and_stay_within_the_drive() -> None:
    fit = fitted(4)
    operator = evolve(fit.layout.operator, lower=0.0, upper=5.0)
    fit.layout = evolve(fit.layout, operator=operator)
    every = list(scans(fit))
    assert len(every) == 2 * SETTINGS.spread_sizes
    for drive, _ in every:
        assert drive[0] == 0.0
        assert drive.min() >= 0.0
        assert drive.max() <= 5.0
    assert every[0][0].max() == 5.0
