"""What a model states beyond its parameters: what it misses on records, and where they move."""

import numpy as np
import pytest
from attrs import evolve

import afm_scan_ros as afm
from afm_scan_ros.core.fit.estimator import AxisFit
from afm_scan_ros.core.fit.model_of_fit import model_of
from afm_scan_ros.core.fit.plays import Plays
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.validation import Validation, spread_of, validate_from
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.prediction import apart
from helpers.fit_cases import GAIN, LIMIT, PERIOD, levels, of_plays_alone

NOISE = 1e-9


@pytest.fixture(scope="module")
def known() -> Knowledge:
    drive = levels(4, 20, 600)
    noise = np.random.default_rng(5).normal(0.0, NOISE, len(drive))
    before = np.concatenate([[0.0], drive[:-1]])  # the input is held between samples
    fit = AxisFit(*of_plays_alone(drive, GAIN * before + noise))
    fit.weigh()
    return Knowledge.of(fit)


@pytest.fixture(scope="module")
def model(known: Knowledge) -> AxisModel:
    return model_of(known.fit)


def left_out(
    model: AxisModel, drive: np.ndarray, error: float, first: int = 0
) -> tuple[afm.Record, Validation]:
    """Return a record that the model misses by a share of the motion, from a sample on."""
    before = np.concatenate([[0.0], drive[:-1]])
    noise = np.random.default_rng(6).normal(0.0, NOISE, len(drive))
    moved = (1.0 + error) * GAIN * before + noise
    record = afm.Record(drive, moved, PERIOD, start="depolarised", name="left out")
    return record, validate_from(model, record, first)


@pytest.mark.parametrize("first", [0, 6000])
def test_a_record_held_out_says_what_is_missed_where_it_moves(
    known: Knowledge, model: AxisModel, first: int
) -> None:
    """Also where its memory is known late."""
    drive = 3.0 * np.sin(2.0 * np.pi * 20.0 * PERIOD * np.arange(10_000))
    alone, with_record = (
        spread_of(known, model, given) for given in ([], [left_out(model, drive, 0.02, first)])
    )
    place = int(np.searchsorted(with_record.bands, 20.0)) - 1
    assert with_record.shares[place] == pytest.approx(0.02, rel=0.05)
    others = np.delete(with_record.shares, place)
    np.testing.assert_array_equal(others, np.delete(alone.shares, place))
    assert np.all(np.array(alone.shares) < 1e-3)


def test_what_parameters_explain_is_not_missed_again(known: Knowledge, model: AxisModel) -> None:
    """An error of half the standard deviation of the parameters is none of the discrepancy's."""
    drive = 3.0 * np.sin(2.0 * np.pi * 20.0 * PERIOD * np.arange(10_000))
    spread = spread_of(known, model, [])
    explained = np.sqrt(np.var(apart(model, spread, drive, PERIOD), axis=1).sum())
    error = 0.5 * float(explained) / float(np.std(GAIN * drive))
    least = DEFAULT_SETTINGS.least_discrepancy
    shares = spread_of(known, model, [left_out(model, drive, error)]).shares
    assert max(shares) == pytest.approx(max(least, *spread.shares))


def test_the_deviation_grows_from_rest_on_and_with_the_motion(
    known: Knowledge, model: AxisModel
) -> None:
    given = evolve(model, spread=spread_of(known, model, []))
    drive = levels(8, 5, 300)
    of_model = afm.Model(ScannerModel(x=given), "a fit")
    _, small = of_model.predict(0.3 * drive, PERIOD, return_std=True)
    moved, large = of_model.predict(0.9 * drive, PERIOD, return_std=True)
    assert np.sqrt(np.mean(large**2)) > np.sqrt(np.mean(small**2))
    assert large.max() > 1.5 * large[0]
    np.testing.assert_allclose(large[0], np.sqrt(np.mean(small[:1] ** 2)) * 3.0, rtol=0.3)
    assert np.all(large < 0.01 * np.ptp(moved))


@pytest.mark.parametrize(("lower", "falls"), [(-LIMIT, False), (0.0, False), (-LIMIT, True)])
def test_what_the_surface_loses_of_the_fit_is_stated(lower: float, *, falls: bool) -> None:
    """Where plays fall after a turn, it is another; of a drive of one sign it loses nothing."""
    drive = np.clip(levels(4, 20, 600), lower, LIMIT)
    layout, records, gain, _ = of_plays_alone(drive, GAIN * drive)
    layout = evolve(layout, operator=Plays(lower, LIMIT))
    theta = layout.start()
    theta[1 : len(layout.operator.thresholds)] = 0.3
    theta[20:40] -= 6.0 if falls else 0.0
    theta[layout.parts["creep"]] = 0.01
    fit = AxisFit(layout, records, gain, theta)
    (simulation,) = fit.simulated(theta)
    noise = np.random.default_rng(5).normal(0.0, NOISE, len(drive))
    exact = evolve(records[0], displacement=gain * simulation.output + noise)
    fit = AxisFit(layout, [exact], gain, theta)
    fit.weigh()
    shares = spread_of(Knowledge.of(fit), model_of(fit), []).shares
    assert (max(shares) > 3.0 * DEFAULT_SETTINGS.least_discrepancy) == falls
