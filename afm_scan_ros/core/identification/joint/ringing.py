"""What rings after the turns of a drive → a resonance.

No density of a hysteresis turns as exactly as the ringing shows: 0.2 rad of its phase, a thirtieth
of a cycle, is 0.3 % of a frequency that is seen for ten cycles. So nothing is asked of the
hysteresis. Where the drive has nothing near a frequency, what moves there rings freely: a damped
sine from an amplitude and a phase of its own after each turn. All have frequency and damping in
common, and what they disagree by from record to record gives the intervals.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import argrelmax
from scipy.stats import f as fisher

from afm_scan_ros.core.effects.vibration import held
from afm_scan_ros.core.identification.joint.moving import Dynamics, MovingRecord
from afm_scan_ros.core.identification.joint.search import (
    DAMPINGS,
    LEVEL,
    Found,
    Resonance,
    half_widths,
)
from afm_scan_ros.core.identification.vibration.local_response import transform
from afm_scan_ros.core.identification.vibration.rational_fit import RESONANT
from afm_scan_ros.core.identification.vibration.spectra import Complex
from afm_scan_ros.core.solver_status import require_converged
from afm_scan_ros.core.types import Array

SAMPLES = 400_000
"""Samples of all records together that are looked at."""
RATIO = 1.06
"""Ratio of neighbouring frequencies that are tried, about as wide as a resonance is."""
FASTEST = 0.25
"""Highest frequency tried, in sample rates."""
BEST = 3
"""Frequencies tried from which a search begins."""
SEVERAL = 3
"""Records, or decays of one, from which on what they disagree by tells the error."""
WIDTH = 0.3
"""Standard deviation of the logarithm of the frequencies that are near another."""
QUIET = 0.01
"""Share of a drive's largest motion near a frequency below which it has none."""
CYCLES = 4
"""Cycles for which a decay is seen at least."""
MAIN = 0.3
"""Share of the displacement at rest from which on a mode is the one that the model has."""


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
    def of(cls, records: Sequence[MovingRecord], frequency: float) -> "Decays":
        """Cut records where their drives are quiet near a ``frequency`` (Hz)."""
        found = [
            (stretch, record.sample_period, number)
            for number, record in enumerate(records)
            for stretch in _quiet(record, frequency * record.sample_period)
        ]
        if len(found) < SEVERAL:
            return cls((), (), (), 0.0)
        moved, periods, numbers = zip(*found, strict=True)
        size = np.linalg.norm(np.concatenate(moved))
        seconds = sum(len(each) * period for each, period in zip(moved, periods, strict=True))
        freedom = 2.0 * np.sqrt(np.pi) * WIDTH * frequency * seconds
        return cls([each / size for each in moved], periods, numbers, float(freedom))

    def residual(self, values: Array) -> Array:
        """What is left beside free decays of values ln ω and ln ζ, stretch after stretch."""
        omega, zeta = np.exp(values)
        pole = omega * (-zeta + 1j * np.sqrt(1.0 - zeta**2))
        left = []
        for moved, period in zip(self.moved, self.sample_periods, strict=True):
            decay = np.exp(pole * period * np.arange(len(moved)))
            base = np.linalg.qr(np.column_stack([decay.real, decay.imag]))[0]
            left.append(moved - base @ (base.T @ moved))
        return np.concatenate(left)

    def strength(self, values: Array) -> float:
        """What decays explain over what they leave, each over its degrees of freedom (F)."""
        taken = 2.0 * len(self.moved)
        left = float(np.sum(self.residual(values) ** 2))
        return (1.0 - left) / taken / (left / (self.freedom - taken))

    def chance(self, tried: int) -> float:
        """Strength that noise exceeds at one of so many frequencies in 2.5 % of cases."""
        taken = 2.0 * len(self.moved)
        return float(fisher.isf((1.0 - LEVEL) / tried, taken, self.freedom - taken))

    def motions(self) -> Sequence[NDArray[np.int64]]:
        """Rows of each record, where they are several, or else of each stretch.

        What hysteresis adds to a decay recurs after every turn of a record.
        """
        of_record = np.array(self.record)
        several = len(set(self.record)) >= SEVERAL
        group = of_record if several else np.arange(len(of_record))
        rows = np.repeat(group, [len(each) for each in self.moved])
        return [np.flatnonzero(rows == each) for each in np.unique(group)]


def resonance(records: Sequence[MovingRecord], before: Dynamics) -> Found | None:
    """Seek a resonance; None where the records do not tell it.

    They tell it where noise would hardly decay so, its frequency is known within its width and its
    damping above the least, and the mode makes most of the displacement.
    """
    records = [record.cut(SAMPLES // len(records)) for record in records]
    tried = _tried(records)
    forms = [Resonance(tried, float(frequency)) for frequency in tried]
    strengths = np.array([_strength(records, form) for form in forms])
    peaks = argrelmax(np.pad(strengths, 1))[0] - 1
    found = (
        _decaying(records, forms[place], before)
        for place in sorted(peaks, key=lambda place: -strengths[place])[:BEST]
    )
    told = [each for each in found if each is not None and all(each.told)]
    return next((each for each in told if _share(records, each.dynamics) > MAIN), None)


def _tried(records: Sequence[MovingRecord]) -> Array:
    """Frequencies (Hz) of which the slowest swings have enough cycles, and samples enough."""
    lowest = 4.0 * CYCLES * min(record.swings for record in records)
    highest = FASTEST / min(record.sample_period for record in records)
    steps = int(np.log(max(highest / lowest, 1.0)) / np.log(RATIO))
    return np.asarray(np.geomspace(lowest, highest, steps))


def _strength(records: Sequence[MovingRecord], form: Resonance) -> float:
    decays = Decays.of(records, form.first)
    return decays.strength(form.bounds[1]) if decays.moved else 0.0


def _decaying(
    records: Sequence[MovingRecord], form: Resonance, before: Dynamics
) -> Found | None:
    """Fit free decays, seen near a form's first frequency and then near the one found.

    The interval reaches as far beyond what they disagree by as the two lie apart.
    """
    lowest, first, highest = form.bounds
    rough = _fitted(Decays.of(records, form.first), form.bounds)
    decays = Decays.of(records, float(np.exp(rough.x[0]) / (2.0 * np.pi)))
    if not decays.moved:
        return None
    found = _fitted(decays, np.array([lowest, rough.x, highest]))
    values = require_converged(found, "decays after the turns of records")
    half = half_widths(decays.motions(), found) + np.abs(values - rough.x)
    told = (
        decays.strength(values) > decays.chance(int(np.log(form.span) / np.log(RATIO)))
        and half[0] < np.exp(values[1]) < RESONANT
        and values[1] - half[1] > np.log(DAMPINGS[0])
    )
    intervals = (form.intervals(values, half),)
    return Found(form.put(before, values), values, (bool(told),), intervals, found.fun)


def _fitted(decays: Decays, bounds: Array):
    lowest, first, highest = bounds
    inside = np.clip(first, lowest + 1e-9, highest - 1e-9)
    return least_squares(decays.residual, inside, bounds=(lowest, highest), x_scale="jac")


def _quiet(record: MovingRecord, frequency: float) -> Iterator[Array]:
    """Displacement near a frequency (cycles a sample) while the drive has nothing of it."""
    near = _near(record.displacement, frequency).real
    driven = np.abs(_near(record.drive, frequency))
    quiet = np.flatnonzero(driven < QUIET * driven.max())
    for stretch in np.split(quiet, np.flatnonzero(np.diff(quiet) > 1) + 1):
        if len(stretch) * frequency > CYCLES:
            yield near[stretch]


def _near(signal: Array, frequency: float, passed: Complex | float = 1.0) -> Complex:
    """Analytic signal, (n,), of what lies near a frequency (cycles a sample) once it ``passed``."""
    spectrum = passed * transform(signal)
    octaves = np.log(np.fft.rfftfreq(len(signal))[1:] / frequency)
    whole = np.zeros(len(signal), complex)
    whole[1 : len(spectrum)] = 2.0 * spectrum[1:] * np.exp(-0.5 * (octaves / WIDTH) ** 2)
    return np.asarray(np.fft.ifft(whole))


def _share(records: Sequence[MovingRecord], dynamics: Dynamics) -> float:
    """Motion near the resonance over what the drive would make of it with the gain at rest."""
    pole = np.roots(dynamics.vibration.denominator)
    frequency = float(np.abs(pole[pole.imag > 0.0][0]) / (2.0 * np.pi))
    shown, expected = 0.0, 0.0
    for record in records:
        period = record.sample_period
        omega = 2.0 * np.pi * np.fft.rfftfreq(len(record.drive), period)
        passed = held(dynamics.vibration, period).response(omega)
        gain = np.ptp(record.displacement) / np.ptp(record.drive)
        model = gain * _near(record.drive, frequency * period, passed)
        shown += float(np.vdot(model, _near(record.displacement, frequency * period)).real)
        expected += float(np.vdot(model, model).real)
    return shown / expected
