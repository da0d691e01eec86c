"""Creep is recovered from a record that scipy integrated."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep_fit import fit_creep
from afm_scan_ros.core.identification.excitation import creep_plan, excitation_block
from afm_scan_ros.core.types import Array

PLAN = creep_plan()
DRIVE = excitation_block(PLAN, 0, PLAN.total_samples).x
PAPER = {
    "Eq. 6": ([1.0, 0.630, 0.0216, 6.25e-5], [1.0, 0.516, 0.0171, 4.69e-5]),
    "Eq. 9": ([1.0, 0.589, 0.0233, 1.48e-5], [1.0, 0.517, 0.0197, 1.14e-5]),
}
NOISE = 2e-9


def record(equation: str, effective: Array) -> Array:
    numerator, denominator = PAPER[equation]
    sampled = signal.cont2discrete((numerator, denominator), PLAN.sample_period)
    rng = np.random.default_rng(5)
    moved = signal.lfilter(sampled[0][0], sampled[1], 3e-6 * effective)
    return moved + NOISE * rng.standard_normal(len(effective))


@pytest.mark.parametrize("equation", PAPER)
def test_gains_and_time_constants_are_recovered(equation: str) -> None:
    # The hysteresis scales each step by a factor of its own, which must not matter.
    effective = np.where(DRIVE > 0.5, 0.5 + 1.3 * (DRIVE - 0.5), DRIVE)
    fit = fit_creep(DRIVE, record(equation, effective), PLAN.sample_period)
    numerator, denominator = PAPER[equation]
    residues, poles, _ = signal.residue(numerator, denominator)
    order = np.argsort(-1.0 / poles.real)
    np.testing.assert_allclose(fit.model.time_constants, (-1.0 / poles.real)[order], rtol=0.02)
    np.testing.assert_allclose(fit.model.gains, (-residues / poles).real[order], rtol=0.02)
    assert fit.fitted.sigma == pytest.approx(NOISE, rel=0.02)
    assert fit.held_out.sigma == pytest.approx(NOISE, rel=0.02)


def test_too_few_elements_show_on_the_held_out_step() -> None:
    fit = fit_creep(DRIVE, record("Eq. 6", DRIVE), PLAN.sample_period, order=1)
    assert fit.held_out.sigma > 3.0 * NOISE


def test_record_without_holds_is_refused() -> None:
    drive = np.linspace(0.0, 1.0, 5000)
    with pytest.raises(InputError, match="holds still 0 times"):
        fit_creep(drive, drive, PLAN.sample_period)
