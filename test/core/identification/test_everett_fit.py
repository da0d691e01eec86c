"""Everett surfaces of a Prandtl-Ishlinskii operator, whose surface is known in closed form."""

from itertools import accumulate

import numpy as np
import pytest

from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import excitation_block, hysteresis_plan
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_fit import (
    TERMS,
    EverettFit,
    fit_everett,
    fit_forward,
    terms_that_serve,
)
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import fit_surface
from afm_scan_ros.core.identification.hysteresis.reversal_curves import (
    ReversalCurves,
    fresh_loops,
    reversal_curves,
)
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.types import Array

THRESHOLDS = np.array([0.0, 0.4, 1.1, 1.7])
WEIGHTS = np.array([0.5, 0.2, 0.15, 0.1])
LIMIT, LEVELS = 2.0, 31


def operator(drive: Array) -> Array:
    """Sum of plays, by the closed form of each between turning points."""
    output = np.zeros_like(drive)
    for threshold, weight in zip(THRESHOLDS.tolist(), WEIGHTS, strict=True):
        plays = accumulate(
            drive.tolist(), lambda p, u, r=threshold: min(max(p, u - r), u + r), initial=0.0
        )
        output += weight * np.array([*plays][1:])
    return output


PLAN = hysteresis_plan(LIMIT, LEVELS)
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x[::10].copy()
EFFECTIVE = operator(DRIVE)
CURVES = reversal_curves(DRIVE)


def fitted(effective: Array, terms: int = 0) -> EverettFit:
    forward = fit_forward(DRIVE, effective, CURVES, LEVELS, terms=terms)
    return fit_everett(DRIVE, effective, CURVES, forward)


@pytest.fixture(scope="module")
def fit() -> EverettFit:
    return fitted(EFFECTIVE)


def test_forward_surface_is_that_of_the_operator(fit: EverettFit) -> None:
    levels = fit.model.forward.levels
    fall = levels[:, None] - levels[None, :]
    plays = np.maximum(fall[..., None] - 2.0 * THRESHOLDS, 0.0)
    expected = np.tril(0.5 * plays @ WEIGHTS)
    # The surface has a kink where a play begins to move, the penalty rounds it.
    np.testing.assert_allclose(fit.model.forward.values, expected, rtol=0.0, atol=5e-3)
    assert fit.model.forward.offset == pytest.approx(EFFECTIVE.min(), abs=2e-3)
    assert fit.closure < 1e-6


def test_both_surfaces_have_the_records_range(fit: EverettFit) -> None:
    forward, direct = fit.model.forward, fit.model.direct
    assert (forward.lower, forward.upper) == pytest.approx((-LIMIT, LIMIT))
    assert forward.values.shape == direct.values.shape == (LEVELS, LEVELS)
    assert (direct.lower, direct.upper) == pytest.approx((EFFECTIVE.min(), EFFECTIVE.max()))
    assert (direct.output_lower, direct.output_upper) == pytest.approx((-LIMIT, LIMIT), abs=5e-3)


def test_loops_that_fitted_nothing_are_predicted(fit: EverettFit) -> None:
    fresh = fresh_loops(fit.model, DRIVE, EFFECTIVE, CURVES.end)
    assert misfit(fresh.exact).sigma < 0.005 * 2.0 * LIMIT
    assert misfit(fresh.direct).sigma < 0.01 * 2.0 * LIMIT
    forward = Preisach(fit.model.forward)
    predicted = forward.apply(forward.saturated(), DRIVE[CURVES.end :])[1]
    assert np.abs(predicted - EFFECTIVE[CURVES.end :]).max() < 0.02 * np.ptp(EFFECTIVE)


def test_curves_that_no_hysteresis_has_are_refused() -> None:
    with pytest.raises(InputError, match="no hysteresis that has an inverse is like them"):
        fit_forward(DRIVE, np.sin(3.0 * DRIVE), CURVES, LEVELS)


def incongruent(drive: Array) -> Array:
    output = operator(drive)
    return output + 0.1 * output**2


def test_both_families_are_right_on_average() -> None:
    effective = incongruent(DRIVE)
    nothing = np.empty((0, 2), dtype=np.int64)
    families = ((CURVES.falling, nothing), (nothing, CURVES.rising))
    rms = []
    for kept in (*families, (CURVES.falling, CURVES.rising)):
        grid = EverettGrid(-LIMIT, LIMIT, LEVELS)
        found = fit_surface(ReversalCurves(*kept, CURVES.end).of(DRIVE, effective), grid)
        errors = [found.predict(c) - c.outputs for c in CURVES.of(DRIVE, effective)]
        rms.append(misfit(np.concatenate(errors)).sigma)
    assert rms[2] < 0.75 * min(rms[:2])


def test_rounds_after_the_first_keep_its_penalty(fit: EverettFit) -> None:
    again = fit_forward(DRIVE, EFFECTIVE, CURVES, LEVELS, fit.forward.strength)
    np.testing.assert_array_equal(again.values, fit.forward.values)


def test_a_map_behind_is_found_where_there_is_one(fit: EverettFit) -> None:
    """Minor loops are then congruent no more; the map makes them so again."""
    noisy = EFFECTIVE + 5e-3 * np.random.default_rng(1).standard_normal(len(EFFECTIVE))
    assert terms_that_serve(DRIVE, noisy, CURVES, fit.forward) == 0
    effective = incongruent(DRIVE)
    without = fitted(effective)
    assert terms_that_serve(DRIVE, effective, CURVES, without.forward) == TERMS
    mapped = fitted(effective, TERMS)
    sigmas = [
        misfit(fresh_loops(found.model, DRIVE, effective, CURVES.end).exact).sigma
        for found in (mapped, without)
    ]
    assert sigmas[0] < 0.5 * sigmas[1]  # the kinks of four plays remain


def test_the_direct_inverse_is_chosen_where_it_is_the_better() -> None:
    """Plays before a map have an inverse that is a Preisach operator, and are none themselves."""
    assert fitted(incongruent(DRIVE)).model.inverse == "direct"
    assert fitted(incongruent(DRIVE), TERMS).model.inverse == "exact"
