"""What records at hand show, and so which need not be taken again."""

import math
from collections.abc import Iterable

import numpy as np
from attrs import frozen
from scipy import signal

from afm_scan_ros.core.effects.resonance import first_resonance
from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.vibration.periodic import is_periodic, repetition
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import Array

BRIEF = 100
"""Parts of a hold of which the second is its beginning: what rings has decayed."""
DRIVEN = 1e4
"""Mean power of a drive's spectrum over the least that counts as driven."""


@frozen
class Coverage:
    """What records at hand show: the longest hold (s), drive range (V) and frequency (Hz).

    ``spacing`` (Hz) is that of the waves, ``resonance`` the frequency (Hz) of the largest response
    to them, ``gain`` m/V; ``fresh`` marks a record that is not fitted. ``creep`` is the
    displacement at the end of the hold over that at its beginning.
    """

    hold: float = 0.0
    loops: float = 0.0
    highest: float = 0.0
    spacing: float = math.inf
    resonance: float | None = None
    gain: float | None = None
    fresh: bool = False
    creep: float = 1.0


def coverage(drive: Array, displacement: Array, sample_period: float) -> Coverage:
    """What one axis of a record shows; drive (V) and displacement (m) both (n,)."""
    kind = recognised(drive)
    swing = float(np.ptp(drive))
    gain = float(np.ptp(displacement)) / swing if swing else None
    if kind == "creep":
        rest = _longest_rest(drive)
        hold = sample_period * (rest.stop - rest.start)
        return Coverage(hold=hold, gain=gain, creep=_creep(displacement, rest))
    if kind == "hysteresis":
        return Coverage(loops=swing, gain=gain)
    if kind == "frequency":
        highest, resonance = response_peak(drive, displacement, sample_period)
        spacing = _spacing(drive, sample_period, resonance)
        return Coverage(highest=highest, spacing=spacing, resonance=resonance)
    return Coverage(fresh=swing > 0.0, gain=gain)


def known_from(model: ScannerModel) -> Coverage:
    """What a model shows of its scanner: its lowest resonance, and its largest slow gain."""
    axes = [model.axis(name) for name in model.axes]
    swings = [axis.hysteresis.forward.upper - axis.hysteresis.forward.lower for axis in axes]
    gains = [2.0 * half_range_of(a) / swing for a, swing in zip(axes, swings, strict=True)]
    try:
        resonance = min(first_resonance(axis.vibration).frequency for axis in axes)
    except InputError:  # it has none
        return Coverage(gain=max(gains))
    return Coverage(resonance=resonance, gain=max(gains))


def combined(parts: Iterable[Coverage]) -> Coverage:
    """Coverage of several records together."""
    together = Coverage()
    for part in parts:
        together = Coverage(
            max(together.hold, part.hold),
            max(together.loops, part.loops),
            max(together.highest, part.highest),
            min(together.spacing, part.spacing),
            part.resonance or together.resonance,
            part.gain if part.loops >= together.loops and part.gain else together.gain,
            together.fresh or part.fresh,
            max(together.creep, part.creep),
        )
    return together


def _longest_rest(drive: Array) -> slice:
    """Samples of the longest rest away from the drive's first level; none where there is none."""
    changes = np.flatnonzero(np.diff(drive)) + 1
    edges = np.concatenate([[0], changes, [len(drive)]])
    away = drive[edges[:-1]] != drive[0]
    lengths = np.where(away, np.diff(edges), 0)
    longest = int(lengths.argmax())
    return slice(int(edges[longest]), int(edges[longest] + lengths[longest]))


def _creep(displacement: Array, rest: slice) -> float:
    """Displacement at the end of a rest over that within its second hundredth."""
    part = max(1, (rest.stop - rest.start) // BRIEF)
    held = displacement[rest]
    before = displacement[max(0, rest.start - part) : max(1, rest.start - 1)].mean()
    early = float(held[part : 2 * part].mean() - before)
    late = float(held[-part:].mean() - before)
    return max(1.0, late / early) if early else 1.0


def _spacing(drive: Array, sample_period: float, frequency: float) -> float:
    """Largest distance (Hz) between a drive's waves within a fifth of a frequency (Hz).

    They are those of its second period, or, as of a sweep, of all of it.
    """
    columns = drive[:, np.newaxis]
    period = repetition(columns) if is_periodic(columns) else 0
    part = drive[period : 2 * period] if period else drive
    spectrum = np.abs(np.fft.rfft(part))
    lines = np.fft.rfftfreq(len(part), sample_period)
    near = (lines > 0.8 * frequency) & (lines < 1.2 * frequency)
    driven = lines[near & (spectrum > spectrum[near].max() / math.sqrt(DRIVEN))]
    return float(np.diff(driven).max(initial=1.0 / (sample_period * len(part))))


def response_peak(drive: Array, displacement: Array, sample_period: float) -> tuple[float, float]:
    """Highest frequency that waves drive, and that of the largest response, both Hz.

    ``drive`` (V) and ``displacement`` (m) are both (n,), ``sample_period`` is in s. By Welch's
    averaged spectra, whose lines are a 16th of the record; noise alone is left out where the drive
    has less than its mean power divided by DRIVEN.
    """
    length = len(drive) // 16
    options = {"fs": 1.0 / sample_period, "nperseg": length}
    frequencies, power = signal.welch(drive, **options)
    cross = signal.csd(drive, displacement, **options)[1]
    driven = power > power.mean() / DRIVEN
    response = np.where(driven, np.abs(cross) / np.where(driven, power, 1.0), 0.0)
    response[:2] = 0.0
    return float(frequencies[driven].max()), float(frequencies[response.argmax()])
