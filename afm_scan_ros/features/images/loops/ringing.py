"""Free decays after the turns of a drive → a resonance.

No density of a hysteresis turns as exactly as the ringing shows: 0.2 rad of its phase, a thirtieth
of a cycle, is 0.3 % of a frequency that is seen for ten cycles. So nothing is asked of the
hysteresis. After each turn a damped sine begins from an amplitude and a phase of its own; frequency
and damping are common to all.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import argrelmax
from scipy.stats import f as fisher

from afm_scan_ros.core.effects.vibration import VibrationModel, held
from afm_scan_ros.core.identification.local_response import Complex, transform
from afm_scan_ros.core.least_squares import require_converged
from afm_scan_ros.core.model import ParameterInterval
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.moving import MovingRecord
from afm_scan_ros.features.images.loops.search import LEVEL, jackknife, of_logarithm

RESONANT = 0.5
"""Damping ratio above which a pole is no resonance."""
SEVERAL = 3
"""Records, or decays of one, from which on their disagreement gives the error."""
WIDTH = 0.3
"""Standard deviation of the logarithm of the frequencies that are near another."""
QUIET = 0.01
"""Share of a drive's largest motion near a frequency below which it has none."""
CYCLES = 4
"""Cycles for which a decay is seen at least."""


@frozen(eq=False)
class Decays:
    """Stretches of displacement near a frequency in which the drive has nothing of it.

    ``moved`` are over the rms of all, ``record`` counts the record that each comes from, and
    ``freedom`` the independent numbers in all: twice bandwidth times time.
    """

    moved: Sequence[Array]
    sample_periods: Sequence[float]
    record: Sequence[int]
    freedom: float

    @classmethod
    def near(cls, frequency: float, records: Sequence[MovingRecord]) -> "Decays | None":
        """Cut records where their drives are quiet near a ``frequency`` (Hz).

        None where there are too few stretches to disagree.
        """
        found = [
            (stretch, record.sample_period, number)
            for number, record in enumerate(records)
            for stretch in _quiet(record, frequency * record.sample_period)
        ]
        if len(found) < SEVERAL:
            return None
        moved, periods, numbers = zip(*found, strict=True)
        size = np.linalg.norm(np.concatenate(moved))
        seconds = sum(len(each) * period for each, period in zip(moved, periods, strict=True))
        freedom = 2.0 * np.sqrt(np.pi) * WIDTH * frequency * seconds
        return cls([each / size for each in moved], periods, numbers, float(freedom))

    def residual(self, values: Array) -> Array:
        """The residual beside free decays of ``values`` ln ω and ln ζ, stretch after stretch."""
        omega, zeta = np.exp(values)
        pole = omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        residual = []
        for moved, period in zip(self.moved, self.sample_periods, strict=True):
            decay = np.exp(pole * period * np.arange(len(moved)))
            base = np.linalg.qr(np.column_stack([decay.real, decay.imag]))[0]
            residual.append(moved - base @ (base.T @ moved))
        return np.concatenate(residual)

    def strength(self, values: Array) -> float:
        """What decays explain over their residual, each over its degrees of freedom (F)."""
        taken = 2.0 * len(self.moved)
        residual = float(np.sum(self.residual(values) ** 2))
        return (1.0 - residual) / taken / (residual / (self.freedom - taken))

    def chance(self, tried: int) -> float:
        """Strength that noise exceeds at one of so many frequencies in 2.5 % of cases."""
        taken = 2.0 * len(self.moved)
        return float(fisher.isf((1.0 - LEVEL) / tried, taken, self.freedom - taken))

    def groupings(self) -> Iterator[Sequence[NDArray[np.int64]]]:
        """Yield rows by stretches, of which the noise differs, and by records, where several.

        What hysteresis adds to a decay recurs after every turn of a record. A few records may agree
        by chance, so neither grouping alone gives the error.
        """
        lengths = [len(each) for each in self.moved]
        yield _rows(np.repeat(np.arange(len(lengths)), lengths))
        if len(set(self.record)) >= SEVERAL:
            yield _rows(np.repeat(self.record, lengths))


def _rows(group: NDArray[np.int64]) -> Sequence[NDArray[np.int64]]:
    """Rows of each group, of the number of every row's, (n,)."""
    return [np.flatnonzero(group == each) for each in np.unique(group)]


def _quiet(record: MovingRecord, frequency: float) -> Iterator[Array]:
    """Displacement near a frequency (cycles a sample) while the drive has nothing of it."""
    moved = near(record.displacement, frequency).real
    driven = np.abs(near(record.drive, frequency))
    quiet = np.flatnonzero(driven < QUIET * driven.max())
    for stretch in np.split(quiet, np.flatnonzero(np.diff(quiet) > 1) + 1):
        if len(stretch) * frequency > CYCLES:
            yield moved[stretch]


def near(signal: Array, frequency: float, passed: Complex | float = 1.0) -> Complex:
    """Analytic signal, (n,), of what lies near a frequency (cycles a sample).

    ``passed`` is a response, (n // 2 + 1,), that the signal goes through first.
    """
    spectrum = passed * transform(signal)
    octaves = np.log(np.fft.rfftfreq(len(signal))[1:] / frequency)
    whole = np.zeros(len(signal), complex)
    whole[1 : len(spectrum)] = 2.0 * spectrum[1:] * np.exp(-0.5 * (octaves / WIDTH) ** 2)
    return np.asarray(np.fft.ifft(whole))


SAMPLES = 400_000
"""Samples of all records together that are looked at."""
RATIO = 1.06
"""Ratio of neighbouring frequencies that are tried, about as wide as a resonance is."""
FASTEST = 0.25
"""Highest frequency tried, in sample rates."""
BEST = 3
"""Frequencies tried from which a search begins."""
DAMPINGS = np.log([1e-3, 0.03, RESONANT])
"""Least, first and greatest logarithm of the damping ratio."""
EDGE = 1e-9
"""How far a search begins inside its bounds."""
MAIN = 0.3
"""Share of the displacement at rest from which on a mode is the one that the model has."""


@frozen(eq=False)
class Ringing:
    """A resonance of gain 1 at rest, and the 95 % intervals of its frequency and damping."""

    vibration: VibrationModel
    frequency: float
    """Hz."""
    intervals: tuple[ParameterInterval, ...]


def mode_of(values: Array) -> VibrationModel:
    """Vibration of gain 1 at rest, 1/(1 + 2ζs/ω + s²/ω²), of ``values`` ln ω and ln ζ."""
    omega, zeta = (float(each) for each in np.exp(values))
    return VibrationModel((1.0,), (1.0 / omega**2, 2.0 * zeta / omega, 1.0))


def mode_intervals(values: Array, half: Array) -> tuple[ParameterInterval, ...]:
    """Intervals of frequency (Hz) and damping (1), of the half-widths of ln ω and ln ζ."""
    hertz = float(values[0] - np.log(2.0 * np.pi))
    return (
        of_logarithm("resonance", hertz, half[0], "Hz"),
        of_logarithm("damping", values[1], half[1], "1"),
    )


def resonance(records: Sequence[MovingRecord]) -> Ringing | None:
    """Seek a resonance; None where the records do not identify it.

    They identify it where noise would hardly decay so, its frequency is known within its width and
    its damping within what is sought, and the mode makes most of the displacement.
    """
    records = list(_begun(records, SAMPLES // len(records)))
    if not records:
        return None
    tried = _tried(records)
    strengths = np.array([_strength(records, float(frequency)) for frequency in tried])
    for place in sorted(argrelmax(strengths)[0], key=lambda each: -strengths[each])[:BEST]:
        found = _decaying(records, float(tried[place]), tried)
        if found is not None and _share(records, found) > MAIN:
            return found
    return None


def _begun(records: Sequence[MovingRecord], samples: int) -> Iterator[MovingRecord]:
    """Yield the first samples of each record that is measured throughout, where they move."""
    for record in records:
        if record.measured is None and all(
            np.ptp(signal[:samples]) > 0.0 for signal in (record.drive, record.displacement)
        ):
            yield record.cut(samples)


def _tried(records: Sequence[MovingRecord]) -> Array:
    """Frequencies (Hz) of which the slowest swings have enough cycles, and samples enough."""
    lowest = 4.0 * CYCLES * min(record.swings for record in records)
    highest = FASTEST / min(record.sample_period for record in records)
    steps = int(np.log(max(highest / lowest, 1.0)) / np.log(RATIO))
    return np.asarray(np.geomspace(lowest, highest, steps))


def _strength(records: Sequence[MovingRecord], frequency: float) -> float:
    decays = Decays.near(frequency, records)
    values = np.array([np.log(2.0 * np.pi * frequency), DAMPINGS[1]])
    return 0.0 if decays is None else decays.strength(values)


def _decaying(records: Sequence[MovingRecord], first: float, tried: Array) -> Ringing | None:
    """Fit free decays, seen near a first frequency (Hz) and then near the one found.

    The intervals reach as far beyond what decays or records disagree by as the two lie apart.
    """
    ends = np.log(2.0 * np.pi * tried[[0, -1]])
    bounds = np.column_stack([ends, DAMPINGS[[0, 2]]])
    rough = _fitted(records, np.array([np.log(2.0 * np.pi * first), DAMPINGS[1]]), bounds)
    fitted = None if rough is None else _fitted(records, rough[1].x, bounds)
    if rough is None or fitted is None:
        return None
    decays, found = fitted
    values = require_converged(found, "decays after the turns of records")
    halves = [jackknife(groups, found.jac, found.fun) for groups in decays.groupings()]
    disagree = np.max(halves, axis=0)
    half = disagree + np.abs(values - rough[1].x)
    known = half[0] < np.exp(values[1]) and half[1] < np.abs(values[1] - DAMPINGS[[0, 2]]).min()
    if not known or decays.strength(values) < decays.chance(len(tried)):
        return None
    frequency = float(np.exp(values[0] - np.log(2.0 * np.pi)))
    return Ringing(mode_of(values), frequency, mode_intervals(values, half))


def _fitted(
    records: Sequence[MovingRecord], begin: Array, bounds: Array
) -> tuple[Decays, OptimizeResult] | None:
    """Decays near where a search begins (ln ω, ln ζ), and the end of the search."""
    decays = Decays.near(float(np.exp(begin[0]) / (2.0 * np.pi)), records)
    if decays is None:
        return None
    inside = np.clip(begin, bounds[0] + EDGE, bounds[1] - EDGE)
    return decays, least_squares(decays.residual, inside, bounds=bounds, x_scale="jac")


def _share(records: Sequence[MovingRecord], found: Ringing) -> float:
    """Motion near the resonance over what the drive would make of it with the gain at rest."""
    observed, expected = 0.0, 0.0
    for record in records:
        period = record.sample_period
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(record.drive), period))
        passed = held(found.vibration, period).response(omega)
        gain = np.ptp(record.displacement) / np.ptp(record.drive)
        model = gain * near(record.drive, found.frequency * period, passed)
        observed += float(np.vdot(model, near(record.displacement, found.frequency * period)).real)
        expected += float(np.vdot(model, model).real)
    return observed / expected
