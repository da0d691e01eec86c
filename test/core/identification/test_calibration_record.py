"""A record that cannot be fitted is refused, with the reason."""

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.recording import CalibrationRecord, misfit
from afm_scan_ros.core.types import Array, Trace

RAMP = np.linspace(0.0, 1.0, 100)


def trace(values: Array, sample_period: float = 1e-3, first: int = 0) -> Trace:
    return Trace(first, sample_period, values, values)


def spoilt(value: float) -> Array:
    values = RAMP.copy()
    values[17] = value
    return values


@pytest.mark.parametrize(
    ("drive", "displacement", "words"),
    [
        (trace(RAMP), trace(spoilt(np.nan)), "displacement x is nan at sample 17"),
        (trace(spoilt(np.inf)), trace(RAMP), "drive x is inf at sample 17"),
        (trace(RAMP), trace(RAMP[:-1]), "100 drive samples, 99 displacement samples"),
        (trace(RAMP), trace(RAMP, 2e-3), "record both at one sample period"),
        (trace(RAMP), trace(np.zeros(100)), "displacement x never changes"),
        (trace(RAMP[:0]), trace(RAMP[:0]), "drive x never changes"),
        (trace(RAMP, first=3), trace(RAMP, first=3), "from its first sample"),
    ],
)
def test_bad_record_is_refused(drive: Trace, displacement: Trace, words: str) -> None:
    with pytest.raises(InputError, match=words):
        CalibrationRecord("creep", drive, displacement)


def test_misfit_is_that_of_the_paper() -> None:
    found = misfit(np.array([3.0, -4.0, 0.0]))
    assert found.sigma == pytest.approx(np.sqrt(25.0 / 2.0))
    assert found.maximum == 4.0
