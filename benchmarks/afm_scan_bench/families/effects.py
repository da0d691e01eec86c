"""Effects of one axis in equations of their own, on scanners of five hysteresis families.

Nothing here is the product's catalogue or its simulated scanner.
"""

from collections.abc import Callable, Mapping

import numpy as np
from attrs import frozen
from scipy.signal import cont2discrete, lfilter

from afm_scan_bench.families.scanners import FamilyScanner
from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.dynamics import Dynamics, detuned_axis
from afm_scan_ros.simulation.scanner import read

MODE, DAMPING = 893.0, 0.01
"""Frequency (Hz) and damping of a mode beside the scanner's."""
HUM, OVERTONE = 50.0, 0.3
SETTLING = 0.2
"""Time constant of a further creep, s."""
HEATED = 1.3
"""Length of a record over the time constant of its drift."""


def _late(drive: Array, period: float, size: float) -> Array:
    time = period * np.arange(len(drive))
    return np.asarray(np.interp(time - size, time, drive, left=0.0))


def _lagging(drive: Array, period: float, size: float) -> Array:
    kept = np.exp(-period / size)
    return np.asarray(lfilter([1.0 - kept], [1.0, -kept], drive))


def _drifting(moved: Array, _: float, size: float) -> Array:
    share = np.arange(len(moved)) / len(moved)
    return np.asarray(moved - size * np.expm1(-HEATED * share))


def _humming(moved: Array, period: float, size: float) -> Array:
    phase = 2.0 * np.pi * HUM * period * np.arange(len(moved))
    return np.asarray(moved + size * (np.sin(phase + 0.7) + OVERTONE * np.sin(2.0 * phase)))


def _bent(moved: Array, _: float, size: float) -> Array:
    return moved + size * moved**2


def _creeping(moved: Array, period: float, size: float) -> Array:
    return moved + size * _lagging(moved, period, SETTLING)


def _ringing(moved: Array, period: float, size: float) -> Array:
    """Add a parallel mode that takes ``size`` of the compliance."""
    stiff = (2.0 * np.pi * MODE) ** 2
    law = [size * stiff], [1.0, 2.0 * DAMPING * np.sqrt(stiff), stiff]
    over, under, _ = cont2discrete(law, period, method="zoh")
    return np.asarray((1.0 - size) * moved + lfilter(over.ravel(), under, moved))


Change = Callable[[Array, float, float], Array]


@frozen(eq=False)
class Alteration:
    """An effect and its name in the catalogue; ``guess`` is a value of its size to begin with.

    It changes the drive (V), the displacement (m), or by a size the gain and first resonance.
    """

    name: str
    guess: float
    drive: Change | None = None
    moved: Change | None = None
    gain: float = 0.0
    resonance: float = 0.0


ALTERATIONS: Mapping[str, Alteration] = {
    "delay": Alteration("delay", 1e-4, drive=_late),
    "lag": Alteration("input_lag", 1e-4, drive=_lagging),
    "gain": Alteration("parameter_shift", 1e-2, gain=1.0),
    "resonance": Alteration("parameter_shift", 2e-2, resonance=1.0),
    "mode": Alteration("extra_resonance", 2e-2, moved=_ringing),
    "drift": Alteration("drift", 3e-7, moved=_drifting),
    "hum": Alteration("periodic_disturbance", 2e-7, moved=_humming),
    "bend": Alteration("static_nonlinearity", 3e2, moved=_bent),
    "creep": Alteration("slow_creep", 1e-2, moved=_creeping),
}


def altered(
    scanner: FamilyScanner, effect: Alteration, size: float, drive: Array, period: float
) -> Array:
    """True displacement (n,) in m of a scanner with an effect, for a drive (n,) in V from rest."""
    if effect.drive:
        drive = effect.drive(drive, period, size)
    plant = default_plant()
    axis = detuned_axis(plant.x, 1.0 - effect.resonance * size, 1.0)
    stage = Dynamics.from_spec(axis, plant.sensor_sensitivity)
    effective = (1.0 - effect.gain * size) * scanner.gain * scanner.operator.apply(drive)
    moved = stage.apply(stage.at_rest(), effective, period)[1]
    return effect.moved(moved, period, size) if effect.moved else moved


def measured(moved: Array, period: float, seed: int) -> Array:
    """What the sensor reads (n,), m."""
    trace = Trace(0, period, moved, moved)
    return read(default_plant().sensor, trace, np.random.default_rng(seed)).x
