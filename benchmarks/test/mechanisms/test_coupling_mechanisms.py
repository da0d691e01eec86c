"""Mechanisms of coupling.py, each against the solution of its equation."""

import numpy as np
import pytest
from scipy import integrate

from afm_scan_bench.mechanisms.coupling import FLEXURES, HOSE_SETTLING, TuggingHose, YawingStage
from afm_scan_ros.core.types import Array
from helpers.acting import STAGE, STIFF_STAGE, TIME, WAVE, S, act, answer, held


def test_a_stage_yaws_by_its_transfer_function() -> None:
    yaw, natural = YawingStage(axis="x", share=0.02, frequency=300.0, damping=0.05), 600.0 * np.pi
    mode = S**2 + 0.1 * natural * S + natural**2
    pushed = 0.02 * natural**2 * (1.0 + S**2 / FLEXURES**2)
    read = act(yaw, WAVE[::-1].copy(), WAVE) - WAVE[::-1]
    np.testing.assert_allclose(read, answer(pushed, mode), atol=1e-12 * 1e-6)


def test_a_hose_pulls_and_relaxes_as_its_elements_do() -> None:
    turning, natural, loss = np.pi / 2.5e-3, STAGE.natural, 2.0 * STAGE.damping * STAGE.natural

    def pulled(t: float, s: Array) -> Array:
        pull = 0.1 * (10e-6 * np.sin(turning * t) + 0.6 * s[2:].mean())
        element = 10e-6 * turning * np.cos(turning * t) - s[2:] / HOSE_SETTLING
        return np.array([s[1], natural**2 * (pull - s[0]) - loss * s[1], *element])

    found = integrate.solve_ivp(
        pulled, (0.0, TIME[-1]), np.zeros(6), "DOP853", TIME, rtol=1e-8, atol=1e-14
    )
    moved = held(TuggingHose(axis="x", share=0.1, relaxing=0.6), np.zeros_like(WAVE), WAVE)
    np.testing.assert_allclose(moved, found.y[0], atol=2e-4 * np.abs(moved).max())


def test_a_hose_held_at_length_pulls_by_its_share_and_at_once_by_more() -> None:
    y = np.full(1_600_000, 1e-6)
    moved = held(TuggingHose(axis="x", share=0.1, relaxing=0.6), np.zeros_like(y), y, STIFF_STAGE)
    assert moved[-1] == pytest.approx(0.1e-6, rel=1e-3)
    assert moved[30] == pytest.approx(0.16e-6, rel=0.03)
