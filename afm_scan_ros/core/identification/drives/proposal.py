"""The records that would identify a scanner, or that are lacking beside those at hand."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt
from numpy.typing import NDArray
from scipy import signal

from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.creep.record import SHORTEST
from afm_scan_ros.core.identification.drives.excitation import (
    FrequencyLines,
    Plan,
    creep_plan,
    frequency_plan,
    hysteresis_plan,
    scaled,
    validation_plan,
)
from afm_scan_ros.core.identification.drives.waveforms import (
    Multisine,
    Raised,
    Waveform,
    Waypoints,
    whole,
)
from afm_scan_ros.core.identification.records.kinds import recognised
from afm_scan_ros.core.identification.vibration.spectra import is_periodic, repetition
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


LINES_PER_RESONANCE = 200.0
"""Lines below a resonance: two within the half-power width of one with a damping of 0.005."""
SURVEY_LINES = 25.0
"""The same of a survey, which is to find the resonance within a few per cent."""
ABOVE_RESONANCE = 4.4
"""Times the resonance up to which waves are needed: an inverse is designed up to there."""
PER_PERIOD = 5.0
"""Samples of the shortest period that a wave may have."""
DECADES = 100.0
"""Lowest resonance that is looked for below the highest frequency driven, where none is known."""
SLOWEST_OF_HOLD = 0.57
"""Longest creep time constant that a hold separates from a drift, over its length."""
RAMP_SECONDS = 0.8
"""Of a ramp from saturation to saturation in the hysteresis record."""
RAMP_SAMPLES = 16_000.0
"""Samples of a ramp from saturation to saturation, which the averages of noise rest on."""
CREEP_SAMPLES = 1e5
"""Samples of a hold at most: creep is slow, and its noise is averaged."""
MARGIN = 1.3
"""Range of a drive over that of the scans. A scan turns round within its range, and reversal curves
begin at saturation: the margin is the hysteresis' width, some 15 % of the range, and as much for
what compensation adds."""
TRIAL_LEVELS, TRIAL_WAVES, TRIAL_PERIODS = 3, 4, 3
"""Of a trial: reversal levels, the waves of full size, and periods of each with its fades."""


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

    plan: Plan[Waveform]
    trial: Plan[Waveform]
    identifies: str
    covers: float

    @property
    def seconds(self) -> float:
        """Length of the record, s."""
        return self.plan.duration

    @property
    def steepest(self) -> float:
        """Steepest slope of the drive and of its trial, V/s."""
        waves = (wave for plan in (self.plan, self.trial) for wave in (plan.x, plan.y))
        return max(float(np.abs(np.diff(whole(w))).max() / w.sample_period) for w in waves)

    def scaled(self, share: float) -> "ProposedRecord":
        """Return the record with all voltages multiplied."""
        plan, trial = (scaled(each, share) for each in (self.plan, self.trial))
        return evolve(self, plan=plan, trial=trial)


def propose(
    converter: ConverterLimits, hold: float, scan_range: float, have: Coverage
) -> Sequence[ProposedRecord]:
    """Records that are lacking for scans over ``scan_range`` (m) and creep of ``hold`` (s).

    Raises InputError where the range is beyond what the converter reaches, and for a hold that is
    too short to show creep.
    """
    if hold < SHORTEST:
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


def _lacking(converter: ConverterLimits, hold: float, have: Coverage) -> Iterator[ProposedRecord]:
    swing = converter.swing
    yield from _frequency(converter, have)
    if have.loops < 1.9 * swing:
        rate = _divided(converter.rate, RAMP_SAMPLES / RAMP_SECONDS)
        loops, trial = hysteresis_plan(swing, rate=rate), hysteresis_plan(swing, TRIAL_LEVELS, rate)
        yield _record(converter, loops, trial, "hysteresis", 2.0 * swing)
    if have.hold < hold:
        rate = _divided(converter.rate, CREEP_SAMPLES / hold)
        fast = max(rate, PER_PERIOD * (have.resonance or 0.0))
        steps = _steps(converter, hold, rate)
        trial = _steps(converter, SHORTEST, _divided(converter.rate, fast))
        yield ProposedRecord(steps, trial, "creep", SLOWEST_OF_HOLD * hold)
    if not have.fresh and have.resonance is not None:
        moves = validation_plan(0.9 * swing, (2, 3), converter.rate, have.resonance)
        yield _record(converter, moves, moves, "error", 1.8 * swing)


def _frequency(converter: ConverterLimits, have: Coverage) -> Iterator[ProposedRecord]:
    """A survey, or, where the resonance is known, the waves that identify it."""
    highest = converter.rate / PER_PERIOD
    if have.resonance is None:
        waves = _waves(converter, highest, highest / DECADES, SURVEY_LINES)
        survey = evolve(frequency_plan(lines=waves), name="survey")
        yield _record(converter, survey, _brief(survey), "resonance", highest)
        return
    highest = min(highest, ABOVE_RESONANCE * have.resonance)
    enough = 1.5 * have.resonance / LINES_PER_RESONANCE
    if have.highest < 0.9 * highest or have.spacing > enough:
        waves = _waves(converter, highest, have.resonance, LINES_PER_RESONANCE)
        plan = frequency_plan(lines=waves)
        yield _record(converter, plan, _brief(plan), "vibration", highest)


def _brief(plan: Plan[Multisine]) -> Plan[Multisine]:
    """The waves of full size, for few periods: each peaks elsewhere."""
    x, y = (
        evolve(axis, waves=axis.waves[:TRIAL_WAVES], repeats=TRIAL_PERIODS)
        for axis in (plan.x, plan.y)
    )
    return Plan(plan.name, x, y)


def _record(
    converter: ConverterLimits,
    plan: Plan[Waypoints] | Plan[Multisine],
    trial: Plan[Waypoints] | Plan[Multisine],
    identifies: str,
    covers: float,
) -> ProposedRecord:
    """Drives about the converter's middle."""
    return ProposedRecord(_raised(plan, converter), _raised(trial, converter), identifies, covers)


def _waves(
    converter: ConverterLimits, highest: float, lowest: float, per_resonance: float
) -> FrequencyLines:
    """Lines up to ``highest``, dense enough for a resonance from ``lowest`` on, both Hz.

    They fall as 1/f above 0.44 times the lowest resonance, so that the drive seldom turns round;
    they are raised as they lie farther apart.
    """
    period = round(converter.rate * per_resonance / lowest)
    lines = _widening(period, converter.rate, highest, lowest, per_resonance)
    corner = 0.44 * lowest * period / converter.rate
    apart = np.sqrt(np.gradient(lines.astype(np.float64)))
    amplitudes = np.minimum(1.0, corner / lines) * apart
    return FrequencyLines(converter.rate, period, lines, amplitudes, 0.375 * converter.swing)


def _widening(
    period: int, rate: float, highest: float, lowest: float, per_resonance: float
) -> NDArray[np.int64]:
    """Lines (cycles a period), (m,): each up to 1.5 times a frequency, then in proportion to it."""
    dense = round(1.5 * lowest * period / rate)
    wide = math.log(highest * period / rate / dense)
    further = np.arange(1, int(per_resonance * wide) + 1) / per_resonance
    sparse = np.rint(dense * np.exp(further)).astype(np.int64)
    return np.unique(np.concatenate([np.arange(2, dense + 1), sparse]))


def _steps(converter: ConverterLimits, hold: float, rate: float) -> Plan[Waypoints]:
    """Two steps of an eighth of the range, or what the upper limit leaves; down where it can be."""
    height = min(converter.swing / 8.0, converter.upper / 2.0)
    down = -1 if converter.lower <= -height else 1
    return creep_plan((hold, hold / 5.0), height, rate, down)


def _divided(rate: float, wanted: float) -> float:
    """Return a whole fraction of a rate (Hz), at least as high as what is wanted."""
    return rate / max(1, int(rate / wanted))


def _raised(plan: Plan[Waypoints] | Plan[Multisine], converter: ConverterLimits) -> Plan[Waveform]:
    """Drive about the converter's middle."""
    if converter.middle == 0.0:
        return Plan(plan.name, plan.x, plan.y)
    seconds = 0.1 * RAMP_SECONDS
    x, y = (Raised(wave, converter.middle, seconds) for wave in (plan.x, plan.y))
    return Plan(plan.name, x, y)
