"""Experiments are ranked by the information that they are expected to give."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.experiments import WeightedChain, expected_bits, rank_experiments
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.scanner import chain_of
from helpers.in_process import default_model

CHAIN = chain_of(default_model().x)
DELAY, LAG = (
    effect_type(name).form("").insert(CHAIN, np.array([1e-4])) for name in ("delay", "input_lag")
)


def credible(*chains: object) -> list[WeightedChain]:
    return [WeightedChain(chain, -np.log(len(chains))) for chain in chains]  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["rest", "broadband"])
def test_one_model_or_the_same_twice_leaves_nothing_to_learn(name: str) -> None:
    for chains in ((DELAY,), (DELAY, DELAY)):
        found = expected_bits(name, "x", default_model(), credible(*chains))
        assert found == pytest.approx(0.0, abs=1e-9)


def test_no_experiment_tells_more_than_is_unknown() -> None:
    found = expected_bits("dither", "x", default_model(), credible(DELAY, LAG))
    assert 0.5 < found < 1.0 + 1e-9


def test_a_scanner_at_rest_tells_least_of_a_delay() -> None:
    ranked = rank_experiments("x", default_model(), credible(DELAY, LAG))
    assert ranked[-1] == "rest" or "rest" not in ranked
    assert ranked[0] != "hold"  # which takes minutes


@settings(max_examples=5)
@given(share=st.floats(0.01, 0.99))
def test_what_is_all_but_certain_leaves_little_to_learn(share: float) -> None:
    logs = np.log([share, 1.0 - share])
    pair = [WeightedChain(c, float(log)) for c, log in zip((DELAY, LAG), logs, strict=True)]
    entropy = -float(np.sum(np.exp(logs) * logs)) / np.log(2.0)
    assert expected_bits("broadband", "x", default_model(), pair) <= entropy + 1e-9
