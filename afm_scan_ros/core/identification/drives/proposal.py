"""The records that would identify a scanner, or that are lacking beside those at hand."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt
from scipy import signal

from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import (
    MOVES,
    Plan,
    creep_plan,
    hysteresis_plan,
    scaled,
    validation_plan,
    waves_plan,
)
from afm_scan_ros.core.identification.drives.waveforms import raised
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.records.motion import turning_points
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_spec import LARGEST_RANGE
from afm_scan_ros.core.types import Array

BRIEF = 100
"""Parts of a hold of which the second is its beginning: what rings has decayed."""
SHORTEST = 10.0
"""Seconds that a hold must last to show creep beyond what rings."""
TURNS, APART = 20, 0.01
"""Levels at which a drive turns to show loops within loops, and their distance over its range."""
DRIVEN = 1e4
"""Mean power of a drive's spectrum over the least that counts as driven."""


@frozen
class Coverage:
    """What records at hand show: the longest hold (s) and the drive range (V) of loops.

    ``resonance`` is the frequency (Hz) of the largest response to waves, ``gain`` m/V; ``fresh``
    marks a record that may be held out: of motion as scans are, or a second one of loops. ``creep``
    is the displacement at the end of the hold over that at its beginning, ``travel`` that of loops
    from peak to peak, m.
    """

    hold: float = 0.0
    loops: float = 0.0
    resonance: float | None = None
    gain: float | None = None
    fresh: bool = False
    creep: float = 1.0
    travel: float = 0.0


def coverage(drive: Array, displacement: Array, sample_period: float) -> Coverage:
    """What one axis of a record shows; drive (V) and displacement (m) both (n,)."""
    kind = recognised(drive)
    swing = float(np.ptp(drive))
    gain = float(np.polyfit(drive, displacement, 1)[0]) if swing else None
    if kind == "creep":
        rest, gain = _longest_rest(drive), float(np.ptp(displacement)) / swing
        hold = sample_period * (rest.stop - rest.start)
        return Coverage(hold=hold, gain=gain, creep=_creep(displacement, rest))
    if kind == "frequency":
        return Coverage(resonance=response_peak(drive, displacement, sample_period))
    turns = np.unique(np.rint(drive[turning_points(drive)] / (APART * swing))) if swing else ()
    if len(turns) >= TURNS:
        return Coverage(loops=swing, gain=gain, travel=float(np.ptp(displacement)))
    return Coverage(fresh=swing > 0.0, gain=gain)


def known_from(model: ScannerModel) -> Coverage:
    """What a model shows of its scanner: its lowest resonance, and its largest slow gain."""
    axes = [model.axis(name) for name in model.axes]
    swings = [float(np.ptp(axis.hysteresis.forward.drive_range)) for axis in axes]
    gains = [2.0 * half_range_of(a) / swing for a, swing in zip(axes, swings, strict=True)]
    try:
        resonance = min(first_resonance(axis.vibration).frequency for axis in axes)
    except InputError:  # it has none
        return Coverage(gain=max(gains))
    return Coverage(resonance=resonance, gain=max(gains))


def of_axes(parts: Sequence[Coverage]) -> Coverage:
    """Coverage of one record by that of each of its axes."""
    return evolve(combined(parts), fresh=any(part.fresh for part in parts))


def combined(parts: Iterable[Coverage]) -> Coverage:
    """Coverage of several records together."""
    together = Coverage()
    for part in parts:
        together = Coverage(
            max(together.hold, part.hold),
            max(together.loops, part.loops),
            part.resonance or together.resonance,
            part.gain if part.loops >= together.loops and part.gain else together.gain,
            together.fresh or part.fresh or min(together.loops, part.loops) > 0.0,
            max(together.creep, part.creep),
            max(together.travel, part.travel),
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


def response_peak(drive: Array, displacement: Array, sample_period: float) -> float:
    """Frequency (Hz) of the largest response of a displacement (m) to a drive (V), both (n,).

    By Welch's averaged spectra, whose lines are a 16th of the record; noise alone is left out where
    the drive has less than its mean power divided by DRIVEN.
    """
    length = len(drive) // 16
    options = {"fs": 1.0 / sample_period, "nperseg": length}
    frequencies, power = signal.welch(drive, **options)
    cross = signal.csd(drive, displacement, **options)[1]
    driven = power > power.mean() / DRIVEN
    response = np.where(driven, np.abs(cross) / np.where(driven, power, 1.0), 0.0)
    response[:2] = 0.0
    return float(frequencies[response.argmax()])


SURVEY_LINES = 25.0
"""Lines below a resonance, which are to find it within a few per cent."""
PER_PERIOD = 5.0
"""Samples of the shortest period that a wave may have."""
DECADES = 100.0
"""Lowest resonance that is looked for below the highest frequency driven, where none is known."""
SLOWEST_OF_HOLD = 0.57
"""Longest creep time constant that a hold separates from a drift, over its length."""
RAISED_SECONDS = 0.08
"""In which a drive rises to the middle of a range that is not about 0 V."""
LEVELS_RATE = 40.0
"""Samples of moves between levels a period of the resonance: their corners last half of one."""
CREEP_SAMPLES = 1e5
"""Samples of a hold at most: creep is slow, and its noise is averaged."""
MARGIN = 1.4
"""Range of a drive over that of the scans. A scan turns round within its range, and a drive's ends
are saturation: the margin is the hysteresis' width, some 15 % of the range, as much for what
compensation adds, and a tenth as a motion is seldom symmetric about rest."""
TRIAL_MOVES, HELD_OUT_MOVES = 48, 80
"""Moves between levels in a trial, and in the record that is held out."""
TRIAL_PERIODS = 3
"""Periods of a trial's waves, with their fades."""


@frozen
class ConverterLimits:
    """Voltages (V) that a converter may give, and samples per second that it gives and takes."""

    lower: float
    upper: float
    rate: float = field(validator=gt(0.0))

    def __attrs_post_init__(self) -> None:
        if not self.lower <= 0.0 < self.upper:
            raise InputError(
                f"a drive of {self.lower:g} to {self.upper:g} V does not start at 0 V: give limits"
                " with 0 V between them or at the lower one"
            )

    @property
    def middle(self) -> float:
        """V about which drives go."""
        return 0.5 * (self.lower + self.upper)

    @property
    def swing(self) -> float:
        """V to either side of the middle."""
        return 0.5 * (self.upper - self.lower)


@frozen(eq=False)
class ProposedRecord:
    """A record to take: its drives, the effects that it identifies and up to where.

    ``trial`` is as large, as fast and as sudden, and shorter where it can be.
    """

    plan: Plan
    trial: Plan
    identifies: str
    covers: float

    @property
    def seconds(self) -> float:
        """Length of the record, s."""
        return self.plan.duration

    @property
    def steepest(self) -> float:
        """Steepest slope of the drive and of its trial, V/s."""
        return max(
            float(np.abs(np.diff(wave)).max()) / plan.sample_period
            for plan in (self.plan, self.trial)
            for wave in (plan.x, plan.y)
        )

    def scaled(self, share: float) -> "ProposedRecord":
        """Return the record with all voltages multiplied."""
        plan, trial = (scaled(each, share) for each in (self.plan, self.trial))
        return evolve(self, plan=plan, trial=trial)


def propose(
    converter: ConverterLimits, hold: float | None, scan_range: float, have: Coverage
) -> Sequence[ProposedRecord]:
    """Records that are lacking for scans over ``scan_range`` (m), and for creep of a ``hold`` (s).

    Without a hold no record of creep is asked for. Raises InputError where the range is beyond what
    the converter reaches, and for a hold that is too short to show creep.
    """
    if scan_range > LARGEST_RANGE:
        raise InputError(
            f"a range of {1e6 * scan_range:.3g} µm is more than any piezoscanner's"
            f" {1e6 * LARGEST_RANGE:g} µm: correct its unit"
        )
    if hold is not None and hold < SHORTEST:
        raise InputError(f"a hold of {hold:g} s shows no creep: hold for {SHORTEST:g} s at least")
    converter = _needed(converter, scan_range, have)
    return tuple(_lacking(converter, hold, have))


def _needed(converter: ConverterLimits, scan_range: float, have: Coverage) -> ConverterLimits:
    """Take of a converter's range what scans need, where the gain is known."""
    if have.gain is None:
        return converter
    swing = 0.5 * MARGIN * scan_range / abs(have.gain)
    if swing > MARGIN * converter.swing:
        raise InputError(
            f"a range of {1e6 * scan_range:.3g} µm needs {2.0 * swing / MARGIN:.3g} V, and the"
            f" limits are {converter.lower:g} to {converter.upper:g} V: at most"
            f" {2e6 * converter.swing * abs(have.gain):.3g} µm are reached"
        )
    share = min(swing / converter.swing, 1.0)
    return evolve(converter, lower=share * converter.lower, upper=share * converter.upper)


def _lacking(
    converter: ConverterLimits, hold: float | None, have: Coverage
) -> Iterator[ProposedRecord]:
    if have.resonance is None:
        highest = converter.rate / PER_PERIOD
        survey, trial = (_survey(converter, highest, count) for count in (7, TRIAL_PERIODS))
        yield _record(converter, survey, trial, "resonance", highest)
    else:
        yield from _levels(converter, have.resonance, have)
    if hold is not None and have.hold < hold:
        rate = _divided(converter.rate, CREEP_SAMPLES / hold)
        fast = max(rate, PER_PERIOD * (have.resonance or 0.0))
        steps = _steps(converter, hold, rate)
        trial = _steps(converter, SHORTEST, _divided(converter.rate, fast))
        yield ProposedRecord(steps, trial, "creep", SLOWEST_OF_HOLD * hold)


def _levels(
    converter: ConverterLimits, resonance: float, have: Coverage
) -> Iterator[ProposedRecord]:
    """Moves between random levels, to be fitted and to be held out."""
    swing, rate = converter.swing, _divided(converter.rate, LEVELS_RATE * resonance)
    if have.loops < 1.9 * swing:
        moves, trial = (
            hysteresis_plan(swing, rate, resonance, count) for count in (MOVES, TRIAL_MOVES)
        )
        yield _record(converter, moves, trial, "hysteresis", 2.0 * swing)
    if not have.fresh:
        moves = validation_plan(0.9 * swing, (2, 3), rate, resonance, HELD_OUT_MOVES)
        yield _record(converter, moves, moves, "error", 1.8 * swing)


def _record(
    converter: ConverterLimits,
    plan: Plan,
    trial: Plan,
    identifies: str,
    covers: float,
) -> ProposedRecord:
    """Drives about the converter's middle."""
    return ProposedRecord(_raised(plan, converter), _raised(trial, converter), identifies, covers)


def _survey(converter: ConverterLimits, highest: float, repeats: int) -> Plan:
    """Waves up to ``highest`` (Hz), dense enough for a resonance from the lowest looked for on.

    Each line is driven up to 1.5 times that one, and then as many as grow in proportion to the
    frequency. They fall as 1/f above 0.44 times it, so that the drive seldom turns round; they are
    raised as they lie farther apart.
    """
    lowest, rate = highest / DECADES, converter.rate
    period = round(rate * SURVEY_LINES / lowest)
    dense = round(1.5 * lowest * period / rate)
    wide = math.log(highest * period / rate / dense)
    further = np.arange(1, int(SURVEY_LINES * wide) + 1) / SURVEY_LINES
    sparse = np.rint(dense * np.exp(further)).astype(np.int64)
    lines = np.unique(np.concatenate([np.arange(2, dense + 1), sparse]))
    corner = 0.44 * lowest * period / rate
    apart = np.sqrt(np.gradient(lines.astype(np.float64)))
    amplitudes = np.minimum(1.0, corner / lines) * apart
    peak = converter.swing / 8.0
    return waves_plan("survey", rate, period, lines, amplitudes, peak, repeats)


def _steps(converter: ConverterLimits, hold: float, rate: float) -> Plan:
    """Two steps of an eighth of the range, or what the upper limit leaves; down where it can be."""
    height = min(converter.swing / 8.0, converter.upper / 2.0)
    down = -1 if converter.lower <= -height else 1
    return creep_plan((hold, hold / 5.0), height, rate, down)


def _divided(rate: float, wanted: float) -> float:
    """Return a whole fraction of a rate (Hz), at least as high as what is wanted."""
    return rate / max(1, int(rate / wanted))


def _raised(plan: Plan, converter: ConverterLimits) -> Plan:
    """Drive about the converter's middle."""
    if converter.middle == 0.0:
        return plan
    rise = plan.sample_period, converter.middle, RAISED_SECONDS
    return evolve(plan, x=raised(plan.x, *rise), y=raised(plan.y, *rise))
