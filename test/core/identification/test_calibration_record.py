"""A record that cannot be fitted is refused, with the reason."""

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.recording import checked, misfit
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, Trace

RAMP = np.linspace(0.0, 1.0, 100)


def trace(values: Array, sample_period: float = 1e-3) -> Trace:
    return Trace(0, sample_period, values, values)


def spoilt(value: float) -> Array:
    values = RAMP.copy()
    values[17] = value
    return values


@pytest.mark.parametrize(
    ("drive", "displacement", "words"),
    [
        (trace(RAMP), trace(spoilt(np.nan)), "displacement is nan at sample 17"),
        (trace(spoilt(np.inf)), trace(RAMP), "drive is inf at sample 17"),
        (trace(RAMP), trace(RAMP[:-1]), "drive has 100 samples and displacement 99"),
        (trace(RAMP), trace(RAMP, 2e-3), "record both at one sample period"),
        (trace(RAMP), trace(np.zeros(100)), "displacement x never changes"),
        (trace(RAMP[:0]), trace(RAMP[:0]), "drive has shape"),
        (trace(RAMP[:99]), trace(RAMP[:99]), "holds 99 samples, too few"),
    ],
)
def test_bad_record_is_refused(drive: Trace, displacement: Trace, words: str) -> None:
    with pytest.raises(InputError, match=words):
        checked(Record.of_traces("creep", drive, displacement))


def test_misfit_is_that_of_the_paper() -> None:
    found = misfit(np.array([3.0, -4.0, 0.0]))
    assert found.sigma == pytest.approx(np.sqrt(25.0 / 2.0))
    assert found.maximum == 4.0
