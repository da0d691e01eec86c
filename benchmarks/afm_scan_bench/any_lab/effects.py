"""Effects of a drawn scanner, in equations of their own; sizes have no unit."""

from collections.abc import Callable, Mapping

import numpy as np
from attrs import evolve, frozen
from scipy.signal import cont2discrete, lfilter

from afm_scan_bench.any_lab.scanner import DRAWN_FOR, DrawnAxis, DrawnScanner
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array

HEATED = 1.3
"""Length of a record over the time constant of its drift."""
OVERTONE = 0.3
FINER = 32
"""Values of a hold, in which a drive circuit moves on."""


@frozen(eq=False)
class Course:
    """One axis of a drawn scanner under a drive: its sample period (s) and its duration (s).

    ``draw`` between 0 and 1 varies what an effect has beside its size.
    """

    axis: DrawnAxis
    sample_period: float
    duration: float
    draw: float

    @property
    def resonance(self) -> float:
        """First resonance, Hz."""
        return self.axis.modes[0].frequency

    @property
    def reach(self) -> float:
        """Displacement of the largest drive, m."""
        return DRAWN_FOR * self.axis.gain

    def moved(self, drive: Array) -> Array:
        """Displacement (n,) in m under a drive (n,) scaled to 4 V."""
        return self.axis.displacement(drive, self.sample_period)


def _late(of: Course, drive: Array, size: float) -> Array:
    time = of.sample_period * np.arange(len(drive))
    return of.moved(np.interp(time - size / of.resonance, time, drive, left=0.0))


def _lagging(of: Course, drive: Array, size: float) -> Array:
    finer = _lag(np.repeat(drive, FINER), size / of.resonance, of.sample_period / FINER)
    return of.moved(_means(finer))


def _means(finer: Array) -> Array:
    """Mean over each hold of a drive, of which a hold has ``FINER`` values."""
    return np.asarray(finer.reshape(-1, FINER).mean(axis=1))


def _lag(signal: Array, time_constant: float, sample_period: float) -> Array:
    kept = np.exp(-sample_period / time_constant)
    return np.asarray(lfilter([1.0 - kept], [1.0, -kept], signal))


def _slewing(of: Course, drive: Array, size: float) -> Array:
    """Follow the drive no faster than its steepest slope less a share."""
    step = (1.0 - size) * float(np.quantile(np.abs(np.diff(drive)), 0.999))
    return of.moved(_means(_slewed(np.repeat(drive, FINER), step / FINER)))


@compiled
def _slewed(wanted: Array, step: float) -> Array:
    followed, now = np.empty_like(wanted), 0.0
    for k in range(len(wanted)):
        now += min(max(wanted[k] - now, -step), step)
        followed[k] = now
    return followed


def _weaker(of: Course, drive: Array, size: float) -> Array:
    return (1.0 - size) * of.moved(drive)


def _softer(of: Course, drive: Array, size: float) -> Array:
    first, *others = of.axis.modes
    modes = (evolve(first, frequency=(1.0 - size) * first.frequency), *others)
    return evolve(of, axis=evolve(of.axis, modes=modes)).moved(drive)


def _ringing(of: Course, drive: Array, size: float) -> Array:
    """Give a share of the compliance to a mode at 1.4 to 3.4 times the first resonance."""
    moved = of.moved(drive)
    stiff = (2.0 * np.pi * of.resonance * (1.4 + 2.0 * of.draw)) ** 2
    law = [size * stiff], [1.0, 0.03 * np.sqrt(stiff), stiff]
    over, under, _ = cont2discrete(law, of.sample_period, method="zoh")
    return np.asarray((1.0 - size) * moved + lfilter(over.ravel(), under, moved))


def _drifting(of: Course, drive: Array, size: float) -> Array:
    share = np.linspace(0.0, 1.0, len(drive))
    return np.asarray(of.moved(drive) - size * of.reach * np.expm1(-HEATED * share))


def _humming(of: Course, drive: Array, size: float) -> Array:
    """Add a tone and its overtone, of which 11 to 60 periods lie in the record."""
    phase = 2.0 * np.pi * (11.3 + 48.7 * of.draw) * np.linspace(0.0, 1.0, len(drive))
    wave = np.sin(phase + 0.7) + OVERTONE * np.sin(2.0 * phase)
    return np.asarray(of.moved(drive) + size * of.reach * wave)


def _bent(of: Course, drive: Array, size: float) -> Array:
    moved = of.moved(drive)
    return moved + size * moved**2 / of.reach


def _creeping(of: Course, drive: Array, size: float) -> Array:
    """Add a creep that lasts a twentieth to a third of the record."""
    moved = of.moved(drive)
    return moved + size * _lag(moved, of.duration * (0.05 + 0.28 * of.draw), of.sample_period)


def _loose(of: Course, drive: Array, size: float) -> Array:
    return _followed(of.moved(drive), 0.5 * size * of.reach)


@compiled
def _followed(moved: Array, half: float) -> Array:
    """Follow with a play of ``half`` to either side."""
    followed, now = np.empty_like(moved), 0.0
    for k in range(len(moved)):
        now = min(max(now, moved[k] - half), moved[k] + half)
        followed[k] = now
    return followed


def _rippling(of: Course, drive: Array, size: float) -> Array:
    """Read the displacement by a scale whose interpolation errs, 5 to 20 periods over the reach."""
    moved, period = of.moved(drive), of.reach / (5.0 + 15.0 * of.draw)
    return moved + size * of.reach * np.sin(2.0 * np.pi * moved / period)


def _wandering(of: Course, drive: Array, size: float) -> Array:
    """Let the gain wander to and fro once or twice in the record."""
    turns = (1.0 + of.draw) * np.linspace(0.0, 1.0, len(drive))
    return of.moved(drive) * (1.0 + size * np.sin(2.0 * np.pi * turns))


def _jumping(of: Course, drive: Array, size: float) -> Array:
    """Let the holder slip to one side or the other, at five moments."""
    rng = np.random.default_rng(int(1e6 * of.draw))
    moments = np.sort(rng.integers(len(drive) // 10, len(drive), 5))
    sides = rng.choice((-1.0, 1.0), 5)
    jumps = np.searchsorted(moments, np.arange(len(drive)), side="right")
    return of.moved(drive) + size * of.reach * np.concatenate([[0.0], sides.cumsum()])[jumps]


Change = Callable[[Course, Array, float], Array]


@frozen(eq=False)
class DrawnEffect:
    """An effect and its name in the catalogue, or "outside"; sizes go up to ``largest``."""

    name: str
    largest: float
    change: Change


EFFECTS: Mapping[str, DrawnEffect] = {
    "delay": DrawnEffect("delay", 1.0, _late),
    "lag": DrawnEffect("input_lag", 1.0, _lagging),
    "slew": DrawnEffect("slew_limit", 0.5, _slewing),
    "gain": DrawnEffect("parameter_shift", 0.4, _weaker),
    "resonance": DrawnEffect("parameter_shift", 0.25, _softer),
    "mode": DrawnEffect("extra_resonance", 0.4, _ringing),
    "drift": DrawnEffect("drift", 0.3, _drifting),
    "hum": DrawnEffect("periodic_disturbance", 0.1, _humming),
    "bend": DrawnEffect("static_nonlinearity", 0.2, _bent),
    "creep": DrawnEffect("slow_creep", 0.3, _creeping),
    "backlash": DrawnEffect("backlash", 0.1, _loose),
}
UNKNOWN: Mapping[str, DrawnEffect] = {
    "ripple": DrawnEffect("outside", 0.1, _rippling),
    "wander": DrawnEffect("outside", 0.2, _wandering),
    "jumps": DrawnEffect("outside", 0.1, _jumping),
}
"""Effects that the catalogue does not hold."""
EVERY: Mapping[str, DrawnEffect] = {**EFFECTS, **UNKNOWN}


def course_of(scanner: DrawnScanner, sample_period: float, samples: int, draw: float) -> Course:
    """Course of the first axis of a scanner."""
    return Course(scanner.axes[0], sample_period, sample_period * samples, draw)
