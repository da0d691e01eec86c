"""A scanner drawn at random: hysteresis of five families, modes, creep, noise and hum.

It shares no code with the product: recursions are SciPy's, hysteresis that of ``families``.
"""

import numpy as np
from attrs import frozen
from scipy import signal

from afm_scan_bench.families.operators import (
    BoucWen,
    Duhem,
    LorentzianPreisach,
    Mapped,
    Operator,
    Plays,
    SlipElements,
    applied,
)
from afm_scan_ros.core.types import Array

FAMILIES = ("play", "slip", "preisach", "bouc_wen", "duhem")
DRAWN_FOR = 4.0
"""V that the operators are made for, to either side; a drive is scaled to it."""


@frozen
class DrawnMode:
    """A resonance (Hz), its damping, and its share of the static displacement."""

    frequency: float
    damping: float
    share: float


@frozen(eq=False)
class DrawnAxis:
    """Drive scaled to 4 V → hysteresis → modes → creep → displacement (m), ``gain`` in m/V."""

    family: str
    hysteresis: Mapped
    modes: tuple[DrawnMode, ...]
    creep: tuple[tuple[float, float], ...]
    gain: float

    @property
    def highest(self) -> DrawnMode:
        """The mode that peaks highest."""
        return max(self.modes, key=lambda mode: mode.share / mode.damping)

    def displacement(self, drive: Array, sample_period: float) -> Array:
        """Noise-free displacement (m) just before each update of a drive (4 V scale), both (n,)."""
        force = applied(self.hysteresis, drive)
        moved = np.zeros(len(drive))
        for mode in self.modes:
            moved += mode.share * _resonating(force, mode, sample_period)
        creeping = [gain * _lagging(moved, tau, sample_period) for gain, tau in self.creep]
        return self.gain * np.asarray(moved + sum(creeping))


@frozen(eq=False)
class DrawnScanner:
    """Axes behind a converter of ``lower`` to ``upper`` V; ``noise`` (m) is white, ``hum`` (Hz, m).

    ``rate`` (Hz) is the sample rate of records that are to show the resonance.
    """

    axes: tuple[DrawnAxis, ...]
    lower: float
    upper: float
    rate: float
    noise: float
    hum: tuple[float, float]

    @property
    def resonance(self) -> float:
        """Lowest resonance, Hz."""
        return min(axis.modes[0].frequency for axis in self.axes)

    @property
    def middle(self) -> float:
        """V about which drives go."""
        return 0.5 * (self.upper + self.lower)

    @property
    def swing(self) -> float:
        """V to either side of the middle."""
        return 0.5 * (self.upper - self.lower)

    def measured(self, drive: Array, sample_period: float, rng: np.random.Generator) -> Array:
        """Measured displacement (m) from depolarised rest under a drive (V), (n, axes)."""
        scaled = DRAWN_FOR / self.upper * drive
        columns = [
            axis.displacement(scaled[:, k], sample_period) for k, axis in enumerate(self.axes)
        ]
        frequency, amplitude = self.hum
        seconds = sample_period * np.arange(len(drive))
        hum = amplitude * np.sin(2.0 * np.pi * (frequency * seconds + rng.random()))
        moved = np.column_stack(columns) + hum[:, np.newaxis]
        return np.asarray(moved + self.noise * rng.standard_normal(moved.shape))


def draw(rng: np.random.Generator, family: str) -> DrawnScanner:
    """Draw a scanner: 150 Hz to 20 kHz, damping 0.003 to 0.1, 1 to 150 V, 1 to 100 µm."""
    resonance, upper = _log(rng, 150.0, 20e3), _log(rng, 1.0, 150.0)
    lower = 0.0 if rng.random() < 0.3 else -upper  # noqa: PLR2004 - share of unipolar drives
    reach = _log(rng, 1e-6, 100e-6)
    axes = tuple(
        _axis(rng, family, resonance * ratio, reach / (2.0 * DRAWN_FOR))
        for ratio in ((1.0,) if rng.random() < 0.5 else (1.0, rng.uniform(1.1, 1.6)))  # noqa: PLR2004
    )
    hum = rng.choice((50.0, 60.0)) * rng.uniform(0.999, 1.001), rng.uniform(0.0, 30e-9)
    noise = reach * _log(rng, 2e-5, 2e-4)
    return DrawnScanner(axes, lower, upper, resonance * _log(rng, 20.0, 60.0), noise, hum)


def _axis(rng: np.random.Generator, family: str, resonance: float, gain: float) -> DrawnAxis:
    modes = [DrawnMode(resonance, _log(rng, 0.003, 0.1), 1.0)]
    if rng.random() < 0.5:  # noqa: PLR2004 - half have a second mode
        share = rng.uniform(0.02, 0.1)
        modes = [
            DrawnMode(resonance, modes[0].damping, 1.0 - share),
            DrawnMode(resonance * rng.uniform(1.8, 3.0), _log(rng, 0.005, 0.05), share),
        ]
    creep = tuple((rng.uniform(0.005, 0.03), tau * rng.uniform(0.7, 1.4)) for tau in (1.0, 30.0))
    return DrawnAxis(family, hysteresis(rng, family), tuple(modes), creep, gain)


def hysteresis(rng: np.random.Generator, family: str) -> Mapped:
    """Draw an operator of a family for ±``DRAWN_FOR``, between two memoryless maps."""
    square, cube = rng.uniform(-0.015, 0.015, 2), rng.uniform(-0.002, 0.002, 2)
    return Mapped(
        _operator(rng, family),
        (float(square[0]), float(cube[0])),
        (float(square[1]), float(cube[1])),
    )


def _operator(rng: np.random.Generator, family: str) -> Operator:
    thresholds = np.linspace(0.05, 3.5, 40)
    weights = np.exp(-thresholds / rng.uniform(1.0, 3.0))
    weights *= rng.uniform(0.25, 0.5) / weights.sum()
    if family == "play":
        return Plays(thresholds, weights)
    if family == "slip":
        return SlipElements(weights * thresholds, weights)
    if family == "preisach":
        width = rng.uniform(0.8, 1.6)
        return LorentzianPreisach(rng.uniform(0.4, 1.0), rng.uniform(0.3, 0.8), width)
    if family == "bouc_wen":
        return BoucWen(rng.uniform(0.25, 0.45), rng.uniform(0.3, 0.6), rng.uniform(-0.2, 0.2))
    return Duhem(rng.uniform(0.4, 1.0), 1.0, rng.uniform(0.6, 0.8))


def _log(rng: np.random.Generator, lowest: float, highest: float) -> float:
    return float(np.exp(rng.uniform(np.log(lowest), np.log(highest))))


def _resonating(force: Array, mode: DrawnMode, sample_period: float) -> Array:
    """Motion under a force that is held from sample to sample."""
    omega = 2.0 * np.pi * mode.frequency
    system = ([omega**2], [1.0, 2.0 * mode.damping * omega, omega**2])
    above, below, _ = signal.cont2discrete(system, sample_period)
    return np.asarray(signal.lfilter(above.ravel(), below, force))


def _lagging(moved: Array, time_constant: float, sample_period: float) -> Array:
    kept = np.exp(-sample_period / time_constant)
    return np.asarray(signal.lfilter([1.0 - kept], [1.0, -kept], moved))
