"""Slopes fitted to reversal curves of Bouc's and Wen's model, which is of another form."""

from functools import cache

import numpy as np
import pytest

from afm_scan_ros.core.effects.hysteresis.duhem import Duhem
from afm_scan_ros.core.identification.drives.excitation import excitation_block, hysteresis_plan
from afm_scan_ros.core.identification.hysteresis.duhem_fit import (
    LEAST,
    FittedSlopes,
    fit_duhem,
    refit,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves

PLAN = hysteresis_plan(levels=25, rate=4e3)
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x[::2].copy()
CURVES = reversal_curves(DRIVE)
NOISE = 2e-3


def bouc_wen(drive: np.ndarray) -> np.ndarray:
    """M. Ismail, F. Ikhouane and J. Rodellar (2009), Eqs. 1 to 3 with n = 1, by Heun's method.

    F = u - h, dh = alpha du - beta |du| h - gamma du |h|.
    """
    alpha, beta, gamma, per_sample = 0.42, 0.6, 0.2, 4
    fine = np.interp(
        np.arange((len(drive) - 1) * per_sample + 1) / per_sample, np.arange(len(drive)), drive
    )
    h, found = 0.0, [0.0]
    for move in np.diff(fine).tolist():
        size = abs(move)
        first = alpha * move - beta * size * h - gamma * move * abs(h)
        ahead = h + first
        h += 0.5 * (first + alpha * move - beta * size * ahead - gamma * move * abs(ahead))
        found.append(h)
    return drive - np.array(found)[::per_sample]


@cache
def true() -> np.ndarray:
    return bouc_wen(DRIVE)


@pytest.fixture(scope="module")
def fitted() -> FittedSlopes:
    noise = np.random.default_rng(5).standard_normal(len(DRIVE))
    return fit_duhem(DRIVE[: CURVES.end], (true() + NOISE * noise)[: CURVES.end])


def test_loops_that_fitted_nothing_are_predicted(fitted: FittedSlopes) -> None:
    effect = fitted.operator
    found = effect.apply(effect.at_rest(), DRIVE)[1]
    assert np.std((found - true())[CURVES.end :]) < 5e-4 * np.ptp(true())


def test_its_inverse_tracks_small_and_large_scans(fitted: FittedSlopes) -> None:
    effect = fitted.operator
    for size in (0.2, 0.8):
        swing = size * min(true().max(), -true().min())
        target = swing * np.interp(np.arange(4501) / 1000, [0.0, 0.5, 1.5, 2.5, 3.5, 4.5], WAY)
        moved = bouc_wen(effect.invert(effect.inverse_at_rest(), target)[1])
        assert np.std((moved - target)[1500:]) < 1e-3 * 2.0 * swing


WAY = [0.0, 1.0, -1.0, 1.0, -1.0, 1.0]


def test_branches_of_a_kind_never_move_apart(fitted: FittedSlopes) -> None:
    slopes = fitted.slopes
    assert np.diff(slopes.rising, axis=1).max() <= 1e-9
    assert np.diff(slopes.falling, axis=1).min() >= -1e-9
    assert min(slopes.rising.min(), slopes.falling.min()) >= 0.99 * LEAST * slopes.chord


def test_noise_is_distinguished_from_what_the_slopes_miss(fitted: FittedSlopes) -> None:
    """Points are averages of some samples, each as noisy as the sensor."""
    points = fitted.branches.counts[fitted.branches.seen]
    assert fitted.noise == pytest.approx(NOISE / np.sqrt(points.mean()), rel=0.15)


def test_an_operator_without_noise_is_found_again_by_the_same_prior(fitted: FittedSlopes) -> None:
    outputs = Duhem(fitted.slopes).apply(fitted.operator.at_rest(), DRIVE)[1]
    again = refit(fitted, DRIVE[: CURVES.end], outputs[: CURVES.end])
    assert again.change_from(fitted) < 1e-4
