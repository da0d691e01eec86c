"""A resonance that the model lacks is seen before anything is fitted."""

import numpy as np
import paper
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.residual_features import APART, likely_modes
from afm_scan_ros.core.effects.vibration import Vibration

PERIOD = 5e-5
CHAIN = Chain(paper.axis())


@pytest.mark.evidence
@settings(deadline=None, max_examples=15)
@given(
    kind=st.sampled_from(["series_mode", "parallel"]),
    frequency=st.floats(150.0, 5000.0),
    damping=st.floats(0.004, 0.05),
    seed=st.integers(0, 1000),
)
def test_a_mode_comes_first_where_the_drive_reaches_it(
    kind: str, frequency: float, damping: float, seed: int
) -> None:
    """Within 3 %, or three quarters of its width, under noise of a thousandth of the residual."""
    random = np.random.default_rng(seed)
    inputs = random.uniform(-1.0, 1.0, 20_000) * np.sin(np.pi * np.arange(20_000) / 20_000)
    other = (
        effect_type("extra_resonance")
        .form(kind)
        .insert(CHAIN, np.array([0.05, frequency, damping]))
    )
    base, moved = (
        effect.apply(effect.at_rest(), inputs)[1]
        for effect in (Vibration(c.model.vibration, PERIOD) for c in (CHAIN, other))
    )
    residual = moved - base
    residual += 1e-3 * np.std(residual) * random.normal(size=residual.size)
    cause = base if kind == "series_mode" else inputs
    found = likely_modes(cause, residual, PERIOD, 3)[0]
    assert found.frequency == pytest.approx(frequency, rel=max(1.5 * damping, 0.03))


def test_modes_lie_apart_and_are_no_more_than_asked_for() -> None:
    moved, residual = np.random.default_rng(1).normal(size=(2, 5000))
    found = likely_modes(moved, residual, PERIOD, 5)
    frequencies = np.sort([mode.frequency for mode in found])
    assert len(found) == 5
    assert (frequencies[1:] / frequencies[:-1] > APART).all()


def test_nothing_moves_nothing_bends() -> None:
    assert likely_modes(np.zeros(5000), np.ones(5000), PERIOD, 5) == []
