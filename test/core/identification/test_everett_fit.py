"""Everett surfaces of a Prandtl-Ishlinskii operator, whose surface is known in closed form."""

import numpy as np
import pytest

from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import excitation_block, hysteresis_plan
from afm_scan_ros.core.identification.fit_report import fresh_loops
from afm_scan_ros.core.identification.hysteresis.everett_fit import EverettFit, fit_everett
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurves,
    reversal_curves,
)
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.types import Array

THRESHOLDS = np.array([0.0, 0.4, 1.1, 1.7])
WEIGHTS = np.array([0.5, 0.2, 0.15, 0.1])
LIMIT, LEVELS = 2.0, 21


def operator(drive: Array) -> Array:
    """Sum of plays, by the closed form of each between turning points."""
    output = np.zeros_like(drive)
    for threshold, weight in zip(THRESHOLDS, WEIGHTS, strict=True):
        position = 0.0
        for k, u in enumerate(drive):
            position = min(max(position, u - threshold), u + threshold)
            output[k] += weight * position
    return output


PLAN = hysteresis_plan(LIMIT, LEVELS)
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x[::10].copy()
EFFECTIVE = operator(DRIVE)
CURVES = reversal_curves(DRIVE)


@pytest.fixture(scope="module")
def fit() -> EverettFit:
    return fit_everett(DRIVE, EFFECTIVE, CURVES, LEVELS)


def test_forward_surface_is_that_of_the_operator(fit: EverettFit) -> None:
    levels = fit.model.forward.levels
    fall = levels[:, None] - levels[None, :]
    plays = np.maximum(fall[..., None] - 2.0 * THRESHOLDS, 0.0)
    expected = np.tril(0.5 * plays @ WEIGHTS)
    # The surface has a kink where a play begins to move, the penalty rounds it.
    np.testing.assert_allclose(fit.model.forward.values, expected, rtol=0.0, atol=5e-3)
    assert fit.model.forward.offset == pytest.approx(EFFECTIVE.min(), abs=2e-3)
    assert fit.closure < 1e-9


def test_both_surfaces_have_the_records_range(fit: EverettFit) -> None:
    forward, direct = fit.model.forward, fit.model.direct
    assert (forward.lower, forward.upper) == pytest.approx((-LIMIT, LIMIT))
    assert forward.values.shape == direct.values.shape == (LEVELS, LEVELS)
    assert (direct.lower, direct.upper) == pytest.approx((EFFECTIVE.min(), EFFECTIVE.max()))
    assert (direct.output_lower, direct.output_upper) == pytest.approx((-LIMIT, LIMIT), abs=5e-3)


def test_loops_that_fitted_nothing_are_predicted(fit: EverettFit) -> None:
    fresh = fresh_loops(fit, DRIVE[CURVES.end :], EFFECTIVE[CURVES.end :])
    assert misfit(fresh.exact).sigma < 0.005 * 2.0 * LIMIT
    assert misfit(fresh.direct).sigma < 0.01 * 2.0 * LIMIT
    forward = Preisach(fit.model.forward)
    predicted = forward.apply(forward.saturated(), DRIVE[CURVES.end :])[1]
    assert np.abs(predicted - EFFECTIVE[CURVES.end :]).max() < 0.02 * np.ptp(EFFECTIVE)


def test_curves_that_cross_are_refused() -> None:
    with pytest.raises(InputError, match="the curves cross there"):
        fit_everett(DRIVE, np.sin(3.0 * DRIVE), CURVES)


def incongruent(drive: Array) -> Array:
    output = operator(drive)
    return output + 0.1 * output**2


def test_both_families_are_right_on_average() -> None:
    effective = incongruent(DRIVE)
    nothing = np.empty((0, 2), dtype=np.int64)
    families = ((CURVES.falling, nothing), (nothing, CURVES.rising))
    rms = []
    for kept in (*families, (CURVES.falling, CURVES.rising)):
        found = fit_everett(DRIVE, effective, ReversalCurves(*kept, CURVES.end), LEVELS)
        errors = [found.forward.predict(c) - c.outputs for c in CURVES.of(DRIVE, effective)]
        rms.append(misfit(np.concatenate(errors)).sigma)
    assert rms[2] < 0.75 * min(rms[:2])


def test_rounds_after_the_first_keep_its_penalties(fit: EverettFit) -> None:
    again = fit_everett(DRIVE, EFFECTIVE, CURVES, LEVELS, strengths=fit.strengths)
    np.testing.assert_array_equal(again.model.forward.values, fit.model.forward.values)
    np.testing.assert_array_equal(again.model.direct.values, fit.model.direct.values)
