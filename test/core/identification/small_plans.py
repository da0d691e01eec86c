"""Drives as the calibration's, of both axes and short, for records that take a moment."""

import numpy as np

from afm_scan_ros.core.identification.drives.excitation import Plan, creep_plan
from afm_scan_ros.core.identification.drives.waveforms import multisine, random_phase_waves
from afm_scan_ros.core.types import Array
from helpers.small_records import levels


def frequency() -> Plan:
    """Lines every 10 Hz to 1 kHz, sampled at 10 kHz, four waves of 0.1 s, and one of them weak."""
    rng, lines = np.random.default_rng(4), np.arange(1, 101)

    def axis() -> Array:
        phases = rng.random((4, len(lines)))
        waves = random_phase_waves(lines, np.minimum(1.0, 20.0 / lines), 1000, phases)
        return multisine(1.5 * np.vstack([waves, 0.3 * waves[:1]]), repeats=6)

    return Plan("frequency", 1e-4, axis(), axis())


PLANS: dict[str, Plan] = {
    "creep": creep_plan((60.0, 30.0)),
    "frequency": frequency(),
    "hysteresis": Plan("hysteresis", 5e-5, levels(8), levels(9)),
    "validation": Plan("validation", 5e-5, levels(7), levels(6)),
}
"""The four records, by name."""
