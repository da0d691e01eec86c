"""Drives as the calibration's, of both axes and short, for records that take a moment."""

import numpy as np

from afm_scan_ros.core.identification.drives.excitation import Plan, creep_plan, hysteresis_plan
from afm_scan_ros.core.identification.drives.waveforms import (
    Multisine,
    Waveform,
    Waypoints,
    random_phase_waves,
)


def frequency() -> Plan[Multisine]:
    """Lines every 10 Hz to 1 kHz, sampled at 10 kHz, four waves of 0.1 s, and one of them weak."""
    rng, lines = np.random.default_rng(4), np.arange(1, 101)

    def axis() -> Multisine:
        phases = rng.random((4, len(lines)))
        waves = random_phase_waves(lines, np.minimum(1.0, 20.0 / lines), 1000, phases)
        return Multisine(1e-4, 1.5 * np.vstack([waves, 0.3 * waves[:1]]), repeats=6)

    return Plan("frequency", axis(), axis())


def validation() -> Plan[Waypoints]:
    """Sixty moves between random levels, 10 to 2000 V/s, sampled at 50 kHz."""
    rng = np.random.default_rng(7)

    def axis() -> Waypoints:
        levels = np.concatenate([[0.0, 0.0], 3.6 * rng.uniform(-1.0, 1.0, 60), [0.0, 0.0]])
        speeds = np.geomspace(10.0, 2000.0, 61)
        moves = np.abs(np.diff(levels[1:-1])) / speeds + 1e-3
        seconds = np.concatenate([[0.1], moves, [0.1]])
        samples = np.concatenate([[0.0], np.cumsum(np.rint(5e4 * seconds))])
        return Waypoints(2e-5, levels, samples, blend=50.0)

    return Plan("validation", axis(), axis())


PLANS: dict[str, Plan[Waveform]] = {
    "creep": creep_plan((60.0, 30.0)),
    "frequency": frequency(),
    "hysteresis": hysteresis_plan(levels=5),
    "validation": validation(),
}
"""The four records, by name."""
