"""Each weakness of a frequency record is found alone, and none in a good one."""

import numpy as np
import pytest
from attrs import astuple

from afm_scan_ros.core.identification.findings import (
    AmplitudeDependentResponse,
    CoarseLines,
    Finding,
    LowCoherence,
    NarrowBand,
)
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.response_checks import response_findings
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
    assert response_findings(record(FINE), RESONANCE, DAMPING) == ()


@pytest.mark.parametrize(
    ("used", "finding"),
    [
        (record(FINE, scatter=0.03), AmplitudeDependentResponse(0.03, 1e-4)),
        (record(FINE, incoherent_from=600.0), LowCoherence(600.0, 0.95)),
        (record(FINE[FINE < 460.0]), NarrowBand((4.0, 458.0), 450.0, (225.0, 540.0))),
        (record(FINE[FINE > 440.0]), NarrowBand((442.0, 798.0), 450.0, (225.0, 540.0))),
        (record(np.arange(10.0, 800.0, 10.0)), CoarseLines(10.0, 10.8)),
    ],
)
def test_each_weakness_is_found_alone(used: FrequencyResponse, finding: Finding) -> None:
    (found,) = response_findings(used, RESONANCE, DAMPING)
    assert type(found) is type(finding)
    numbers, expected = (np.hstack(astuple(each)) for each in (found, finding))
    assert numbers == pytest.approx(expected, rel=0.01)


def test_one_bad_line_is_no_bad_band() -> None:
    good = record(FINE)
    good.coherence[50] = 0.5
    assert response_findings(good, RESONANCE, DAMPING) == ()
