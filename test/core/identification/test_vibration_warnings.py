"""What a record cannot tell is said in words, and nothing is said of a good one."""

import numpy as np
import pytest

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.words import vibration_warnings
from afm_scan_ros.core.types import Array

RESONANCE, DAMPING = 450.0, 0.012


def record(
    frequency: Array, scatter: float = 1e-3, incoherent_from: float = np.inf
) -> FrequencyResponse:
    ones = np.ones(len(frequency))
    coherence = np.where(frequency < incoherent_from, 0.9999, 0.8)
    omega = 2.0 * np.pi * frequency
    return FrequencyResponse(omega, ones.astype(complex), 1e-4 * ones, scatter * ones, coherence)


FINE = np.arange(4.0, 800.0, 2.0)


def test_good_record_warns_of_nothing() -> None:
    assert vibration_warnings(record(FINE), RESONANCE, DAMPING) == ()


@pytest.mark.parametrize(
    ("used", "words"),
    [
        (record(FINE, scatter=0.03), "hysteresis in the small-signal record: waves differ by 3.0%"),
        (record(FINE, incoherent_from=600.0), "coherence is too low from 600 Hz"),
        (record(FINE[FINE < 460.0]), "the band is too narrow: 4 to 458 Hz"),
        (record(FINE[FINE > 440.0]), "the band is too narrow: 442 to 798 Hz"),
        (record(np.arange(10.0, 800.0, 10.0)), "the lines are too coarse: every 10.0 Hz"),
    ],
)
def test_each_weakness_is_named_alone(used: FrequencyResponse, words: str) -> None:
    (sentence,) = vibration_warnings(used, RESONANCE, DAMPING)
    assert words in sentence
    assert ";" in sentence  # and what to record instead


def test_one_bad_line_is_no_bad_band() -> None:
    good = record(FINE)
    good.coherence[50] = 0.5
    assert vibration_warnings(good, RESONANCE, DAMPING) == ()
