"""What alternating identification refuses."""

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import AxisRecord, Sizes, alternate
from afm_scan_ros.core.identification.drives.excitation import excitation_block, hysteresis_plan
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves


@pytest.mark.evidence
def test_ramps_too_fast_to_be_distinguished_from_noise_are_refused() -> None:
    plan = hysteresis_plan(levels=6)
    drive = excitation_block(plan, 0, plan.total_samples).x
    fast = AxisRecord(drive, 1e-6 * drive, plan.sample_period / 100.0)
    sweep = AxisRecord(np.sin(drive), np.sin(drive), plan.sample_period)
    with pytest.raises(InputError, match=r"longest curve takes .* ms; let a ramp"):
        alternate(fast, sweep, reversal_curves(drive), Sizes())
