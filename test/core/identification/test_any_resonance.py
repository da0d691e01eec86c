"""Whole identifications of scanners whose resonance lies anywhere, at several sample rates."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.identification.drives.excitation import creep_plan, hysteresis_plan
from afm_scan_ros.core.identification.drives.waveforms import multisine, random_phase_waves
from afm_scan_ros.core.identification.findings import Hum
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.axis import PlayBank

GAIN = 4e-6
"""m/V"""
Modes = tuple[tuple[float, float, float], ...]


def moved(name: str, drive: Array, period: float, modes: Modes, hum: float = 0.0) -> Record:
    """Plays, then modes (Hz, damping, share of the gain) in parallel, then creep and a sensor."""
    rng = np.random.default_rng(len(drive))
    plays = PlayBank(np.linspace(0.02, 5.0, 80), np.full(80, 4e-3), 1.0, 0.0, 0.0)
    effective = plays.apply(plays.relaxed(), drive)[1]
    displacement = 1.5e-9 * rng.standard_normal(len(drive))
    for frequency, damping, share in modes:
        omega = 2.0 * np.pi * frequency
        mode = [share * omega**2], [1.0, 2.0 * damping * omega, omega**2]
        b, a, _ = signal.cont2discrete(mode, period)
        displacement += GAIN * signal.lfilter(b[0], a, effective)
    slow = signal.cont2discrete(([0.1], [2.0, 1.0]), period)
    displacement += GAIN * signal.lfilter(slow[0][0], slow[1], effective)
    displacement += hum * np.sin(2.0 * np.pi * 50.06 * period * np.arange(len(drive)))
    return Record(drive, displacement, period, name=name)


def records(modes: Modes, rate: float, highest: float, hum: float) -> list[Record]:
    """Creep, multisines up to ``highest`` Hz sampled at ``rate`` Hz, and random levels."""
    slow, loops = creep_plan((60.0, 30.0)), hysteresis_plan()
    period = int(4.0 / min(frequency * damping for frequency, damping, _ in modes) * rate)
    lines = np.arange(2, int(highest / rate * period))
    phases = np.random.default_rng(1).random((1, len(lines)))
    amplitudes = np.minimum(1.0, 0.1 * lines[-1] / lines)
    waves = 0.5 * random_phase_waves(lines, amplitudes, period, phases)
    return [
        moved("creep", slow.x, slow.sample_period, modes),
        moved("frequency", multisine(waves, 6), 1.0 / rate, modes, hum),
        moved("hysteresis", loops.x, loops.sample_period, modes),
    ]


CASES = {
    "above the paper's": (((820.0, 0.012, 1.0),), 20e3, 2e3, 15e-9),
    "two": (((700.0, 0.02, 1.0), (1100.0, 0.01, 0.1)), 20e3, 2e3, 0.0),
}


@pytest.mark.evidence
@pytest.mark.parametrize("case", CASES)
def test_the_resonance_is_found(case: str) -> None:
    modes, rate, highest, hum = CASES[case]
    found = identify_axis(records(modes, rate, highest, hum), "x")
    stated = found.model.effects.vibration.intervals[0]
    assert stated.name == "resonance"
    assert (stated.lower + stated.upper) / 2.0 == pytest.approx(modes[0][0], rel=1e-3)
    named = [each for each in found.warnings if isinstance(each, Hum)]
    assert [each.record for each in named] == ["frequency"] * (hum > 0.0)
    assert found.deviation < 0.01
