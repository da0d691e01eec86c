"""A residual of a known kind is described as what it is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.description import (
    coherence,
    correlation,
    dependences,
    locked,
    to_and_fro,
)
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.residual_report import Description, describe
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import phases, total_samples
from afm_scan_ros.core.types import Array
from helpers.in_process import ALL, default_model, scan

PERIOD = 1e-3
SPEC = ScanSpec(lines=6, samples_per_line=400, preparation="none")
seeds = st.integers(0, 2**31)


def noise(count: int, seed: int) -> Array:
    return np.random.default_rng(seed).normal(size=count)


def of_lines(signal: Array) -> Array:
    """A whole scan that holds a signal on its lines, zero before and after."""
    whole = np.zeros(total_samples(SPEC))
    whole[phases(SPEC).lines.start : phases(SPEC).lines.stop] = signal
    return whole


@given(seed=seeds)
@settings(deadline=None, max_examples=10)
def test_white_noise_lies_within_both_bands(seed: int) -> None:
    found = correlation(noise(20_000, seed), None, PERIOD, 1)
    assert found.white == pytest.approx(1.96 / np.sqrt(20_000))
    assert found.outside_white < 0.2
    assert found.outside_bootstrap < 0.4


def test_correlation_is_outside_the_band_of_white_noise_but_not_of_the_bootstrap() -> None:
    found = correlation(np.convolve(noise(20_100, 3), np.ones(101), "valid"), None, PERIOD, 1)
    near = found.lags < 50 * PERIOD
    assert np.all(found.values[near] > 10.0 * found.white)
    assert found.bootstrap > 2.0 * found.white
    assert found.outside_bootstrap < 0.4


@given(seed=seeds, delay=st.integers(1, 300))
@settings(deadline=None, max_examples=10)
def test_what_follows_a_signal_correlates_at_its_delay(seed: int, delay: int) -> None:
    signal = noise(20_000, seed)
    found = correlation(np.roll(signal, delay), signal, PERIOD, 1)
    nearest = np.argmin(np.abs(found.lags - delay * PERIOD))
    if found.lags[nearest] == pytest.approx(delay * PERIOD):
        assert found.values[nearest] == pytest.approx(1.0, abs=0.02)
    others = np.delete(found.values, nearest)
    assert np.abs(others).max() < 0.1


def test_a_long_record_is_averaged_and_keeps_its_lags() -> None:
    slow = np.convolve(noise(200_999, 3), np.ones(1000), "valid")
    found = correlation(slow, None, PERIOD, 1)
    at_half = np.interp(0.5, found.lags, found.values)
    assert at_half == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(
    ("signal", "share"),
    [
        (np.tile(np.sin(np.arange(400.0)), 6), "to_scan"),
        (np.repeat(np.arange(6.0), 400), "to_time"),
        (noise(2400, 1), "rest"),
    ],
)
def test_what_repeats_is_told_from_what_drifts(signal: Array, share: str) -> None:
    found = locked(of_lines(signal), SPEC)
    assert found is not None
    assert found.to_scan + found.to_time + found.rest == pytest.approx(1.0)
    assert getattr(found, share) > 0.9


def test_trace_and_retrace_are_compared_at_the_same_place() -> None:
    way = np.abs((np.arange(400) / 200.0 + 1.0) % 2.0 - 1.0)
    direction = np.where(np.arange(400) < 200, 1.0, -1.0)
    place = to_and_fro(of_lines(np.tile(way - way.mean(), 6)), SPEC)
    turned = to_and_fro(of_lines(np.tile(direction, 6)), SPEC)
    assert place is not None
    assert turned is not None
    assert place.unlike == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(place.trace, place.retrace)
    assert turned.equivalent < 0.1 * turned.unlike


def test_two_lines_are_too_few_to_repeat() -> None:
    few = ScanSpec(lines=2, samples_per_line=400, preparation="none")
    assert locked(np.zeros(total_samples(few)), few) is None


MOVED = 1e-5 * np.sin(2.0 * np.pi * np.arange(4000) / 400.0) * np.linspace(0.2, 1.0, 4000)
"""Ten turns of rising amplitude."""


@pytest.mark.parametrize(
    ("residual", "quantity"),
    [
        (MOVED**2, "position"),
        (np.gradient(MOVED), "speed"),
        (np.linspace(-1.0, 1.0, 4000) ** 3, "time"),
    ],
)
def test_residual_goes_with_what_makes_it(residual: Array, quantity: str) -> None:
    found = dependences(residual - residual.mean(), MOVED, PERIOD)
    shares = {name: each.share for name, each in found.items()}
    assert max(shares, key=shares.__getitem__) == quantity
    assert shares[quantity] > 0.95


@given(seed=seeds)
@settings(deadline=None, max_examples=10)
def test_bins_hold_all_of_the_residual(seed: int) -> None:
    residual = noise(len(MOVED), seed)
    for each in dependences(residual, MOVED, PERIOD).values():
        assert each.count.sum() == len(residual)
        assert each.count @ each.rms**2 == pytest.approx(residual @ residual)
        assert 0.0 <= each.share <= 1.0


def test_coherence_is_one_with_the_cause_and_chance_with_another() -> None:
    cause, other = noise(40_000, 1), noise(40_000, 2)
    edges = (0.0, 100.0, 300.0, 500.0)
    caused = coherence(np.convolve(cause, [0.2, 0.5, 0.3], "same"), cause, PERIOD, edges)
    unrelated = coherence(other, cause, PERIOD, edges)
    assert np.all(caused.values > 0.95)
    assert np.all(unrelated.values < caused.chance)


@pytest.fixture(scope="module")
def description() -> Description:
    done = scan(ScanSpec(lines=4, samples_per_line=1000, preparation_cycles=5), ALL)
    observed = Record.of_traces("scan", done.drive, done.measured, done.spec)
    evidence = evidence_of("x", default_model(), observed)
    return describe(evidence, chain_of(default_model().x), observed)


def test_bands_hold_all_of_the_residual(description: Description) -> None:
    assert np.linalg.norm(description.bands) == pytest.approx(description.rms)


def test_all_signals_are_compared(description: Description) -> None:
    signals = {"drive x", "drive y", "displacement of the other axis"}
    assert set(description.correlations) == set(description.coherences) == signals
    assert description.initial_state.blank
    assert description.repeats is not None
    assert description.sides is not None
