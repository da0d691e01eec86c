"""Records that are not of one scanner, or not enough of it, are named."""

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.agreement import (
    loops_after,
    refuse_other_gain,
    refuse_unlike,
)
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.drives.excitation import hysteresis_plan
from afm_scan_ros.core.identification.drives.waveforms import whole
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves

DRIVE = whole(hysteresis_plan(levels=5).x)
CURVES = reversal_curves(DRIVE)


def record(drive: np.ndarray) -> AxisRecord:
    return AxisRecord(drive, np.zeros_like(drive), 1e-4)


SMALL = record(0.4 * DRIVE)


def test_records_that_belong_together_pass() -> None:
    refuse_unlike(SMALL, SMALL, record(DRIVE))
    refuse_other_gain(1.05)


def test_a_record_that_ends_with_its_curves_has_no_loops_after_them() -> None:
    assert loops_after(record(DRIVE), CURVES)
    assert not loops_after(record(DRIVE[: CURVES.end]), CURVES)


def test_a_drive_in_another_unit_is_named() -> None:
    millivolts = record(400.0 * DRIVE)
    words = r"frequency record: its drive reaches 1600 V, that of the hysteresis record only 4 V"
    with pytest.raises(InputError, match=words):
        refuse_unlike(SMALL, millivolts, record(DRIVE))
    with pytest.raises(InputError, match=r"creep record: its drive reaches 1600 V"):
        refuse_unlike(millivolts, SMALL, record(DRIVE))


@pytest.mark.parametrize("ratio", [-1.0, 0.01, 0.49, 2.1, 1e3])
def test_a_gain_of_another_scanner_or_sign_is_named(ratio: float) -> None:
    with pytest.raises(InputError, match=r"times the gain of the hysteresis record"):
        refuse_other_gain(ratio)
