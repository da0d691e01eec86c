"""Times as loggers write them: rounded, jittering, with gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.timing import timing_of

NUMBER, PERIOD = 5000, 1e-3
EVEN = PERIOD * np.arange(NUMBER)
NOISE = 2e-9


def moved(time: np.ndarray, noise: float = NOISE) -> np.ndarray:
    rng = np.random.default_rng(3)
    return 5e-6 * np.sin(2.0 * np.pi * time) + noise * rng.standard_normal(len(time))


@given(
    rate=st.floats(10.0, 1e5),
    start=st.floats(0.0, 1e3),
    digits=st.integers(2, 6),
    floor=st.booleans(),
)
@settings(deadline=None)
def test_rounded_times_of_an_even_clock(
    rate: float, start: float, digits: int, *, floor: bool
) -> None:
    digit = 10.0 ** -(digits + np.ceil(np.log10(rate)))
    exact = start + np.arange(NUMBER) / rate
    written = digit * (np.floor if floor else np.round)(exact / digit)
    found = timing_of(written)
    assert found.sample_period == pytest.approx(1.0 / rate, rel=2.0 * digit * rate / NUMBER)
    assert not found.note


@pytest.mark.evidence
@pytest.mark.parametrize("digits", [6, 7])
def test_times_of_few_significant_digits(digits: int) -> None:
    """At 100 s with seven digits, two samples in three have the same time."""
    written = np.array([float(f"{k / 20e3:.{digits}g}") for k in range(2_100_000)])
    found = timing_of(written)
    assert found.sample_period == pytest.approx(5e-5, rel=10.0 ** (2 - digits))
    with pytest.raises(InputError, match=r"time (runs 0\.1|is irregular)"):
        timing_of(np.concatenate([written[:1000], written[1000:] + 0.1]))


def test_jitter_below_the_noise_is_stated() -> None:
    rng = np.random.default_rng(1)
    time = EVEN + 1e-5 * rng.standard_normal(NUMBER)
    found = timing_of(time, [moved(time)])
    assert found.sample_period == pytest.approx(PERIOD, rel=1e-5)
    assert "time jitters by 1e-05 s rms, which moves a displacement by" in found.note
    assert "taken as every 0.001000" in found.note


def test_jitter_that_a_displacement_shows_is_refused() -> None:
    time = EVEN + 5e-5 * np.random.default_rng(1).standard_normal(NUMBER)
    with pytest.raises(
        InputError, match=r"irregular: .* moves a displacement by .* give the sampl"
    ):
        timing_of(time, [moved(time)])


def test_jitter_without_a_displacement_is_refused() -> None:
    time = EVEN + 1e-5 * np.random.default_rng(1).standard_normal(NUMBER)
    with pytest.raises(InputError, match="time is irregular"):
        timing_of(time)


def test_a_lost_row_is_named() -> None:
    time = np.delete(EVEN, 1200) + 1e-6 * np.random.default_rng(1).standard_normal(NUMBER - 1)
    with pytest.raises(
        InputError, match=r"time runs 0.00199.* s from row 1210 to row 1211, elsewhere"
    ):
        timing_of(time, [moved(time)], first_row=11)


def test_times_too_coarse_for_a_period_are_refused() -> None:
    time = np.round(np.arange(40) / 30.3, 2)
    with pytest.raises(InputError, match=r"rounded to 0.01 s, which leaves .* uncertain by 0.8%"):
        timing_of(time)
