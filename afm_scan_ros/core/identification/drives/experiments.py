"""Drives that distinguish effects which look alike in a scan, for an unclear residual.

Each begins at depolarised rest and ends at rest, after large moves by loops that fade. x and y
never move alike, so that the effect of each axis on the other is identifiable as well.
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import scipy
from attrs import evolve, frozen

from afm_scan_ros.core.effects.scale import REFERENCE_VOLTAGE, scale_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS, Plan, scaled
from afm_scan_ros.core.identification.drives.waveforms import (
    Chirp,
    InTurn,
    Multisine,
    Raised,
    Sampled,
    Scaled,
    SteppedSine,
    Together,
    Waveform,
    Waypoints,
    fading,
    moves,
    random_phase_waves,
    still,
    triangles,
    waves_between,
    whole,
)
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.types import Array

SLOW, RATE, FAST = 100.0, 20e3, 50e3
"""Sample rates, Hz."""
LARGE = 3.0
"""V; scans seldom go further."""
SWEPT = 1.2
"""V up to 100 Hz, above it as 1/f: of loops this large the Everett surface knows the hysteresis."""
SHAKEN = 2.7
"""V, of waves that shake each other: larger ones mix to more above 2 kHz, which no model knows."""
QUIET = 0.5
"""Seconds of rest before and after a drive: it gives the sensor's noise."""

TOO_FAST = 0.01
"""Share of a drive's rms that may be faster than half of another sample rate."""

UNIPOLAR = 0.5
"""Ratio of a model's limits up to which its drive goes about their middle instead of 0 V."""
RISE = 1.0
"""Seconds to that middle on the reference scanner."""


@frozen
class Experiment:
    """A drive for the reference scanner, and what it is for.

    One of the ``stage`` has times that scale with its first resonance; creep and drift do not.
    """

    plan: Callable[[], Plan[Waveform]]
    purpose: str
    stage: bool = True

    def plan_for(
        self, model: ScannerModel, amplitude: float | None = None, duration: float | None = None
    ) -> Plan[Waveform]:
        """Return the drive for the scanner of a model: as large a part of its range.

        An axis that the model lacks rests. Another ``amplitude`` (V) is that of the axis that is
        driven further. Another ``duration`` (s) changes all times.
        """
        plan = self.plan()
        size = 1.0 if amplitude is None else amplitude / (self.amplitude_for(model) or 1.0)
        stretch = 1.0 if duration is None else duration / self.duration_for(model)
        time = stretch * self._time(model)
        x, y = (
            _scaled(wave, model.axis(name), size, time)
            if name in model.axes
            else Scaled(wave, 0.0, time)
            for name, wave in (("x", plan.x), ("y", plan.y))
        )
        return Plan(plan.name, x, y)

    def amplitude_for(self, model: ScannerModel) -> float:
        """Largest voltage from the middle of the drive for the scanner of a model; 0 at rest."""
        return _own_peak(self.plan) * self.largest_for(model) / REFERENCE_VOLTAGE

    @staticmethod
    def largest_for(model: ScannerModel) -> float:
        """Largest voltage from the middle of a drive that stays in the identified range."""
        return max(_half_range(model.axis(name)) for name in model.axes)

    def duration_for(self, model: ScannerModel) -> float:
        """Length (s) of the drive for the scanner of a model."""
        return self.plan_for(model).duration

    def _time(self, model: ScannerModel) -> float:
        times = [scale_of(model.axis(name)).time for name in model.axes]
        return max(times) if self.stage else 1.0


@cache
def _own_peak(plan: Callable[[], Plan[Waveform]]) -> float:
    return peak(plan())


def peak(plan: Plan[Waveform]) -> float:
    """Largest voltage of a drive about 0 V."""
    return max(float(np.abs(whole(wave)).max()) for wave in (plan.x, plan.y))


def resized(
    plan: Plan[Waveform], amplitude: float | None, duration: float | None
) -> Plan[Waveform]:
    """Return a drive about 0 V with another ``amplitude`` (V) or ``duration`` (s), where given."""
    if amplitude is None and duration is None:
        return plan
    size = 1.0 if amplitude is None else amplitude / (peak(plan) or 1.0)
    time = 1.0 if duration is None else duration / plan.duration
    return scaled(plan, size, time)


def resampled(plan: Plan[Waveform], rate: float) -> Plan[Sampled]:
    """Return a drive at ``rate`` samples a second.

    Raises InputError where more than ``TOO_FAST`` of it is faster than half the rate.
    """
    return Plan(plan.name, *(_resampled(plan, wave, rate) for wave in (plan.x, plan.y)))


def _resampled(plan: Plan[Waveform], wave: Waveform, rate: float) -> Sampled:
    drive = whole(wave)
    power = np.abs(np.fft.rfft(drive - drive.mean())) ** 2
    frequency = np.fft.rfftfreq(len(drive), wave.sample_period)
    remaining = np.sqrt(np.cumsum(power[::-1])[::-1])
    needed = (
        2.0 * frequency[np.sum(remaining > TOO_FAST * remaining[0]) - 1] if remaining[0] else 0.0
    )
    if rate < (1.0 - 1e-5) * needed:  # as the message rounds it
        raise InputError(
            f"{plan.name}: {rate:.6g} samples a second are too few for this drive: give at least"
            f" {needed:.6g}, or another experiment"
        )
    before = wave.sample_period * np.arange(len(drive))
    after = np.arange(0.0, before[-1], 1.0 / rate)
    values = scipy.interpolate.make_interp_spline(before, drive, k=3)(after)
    return Sampled(1.0 / rate, np.append(values, drive[-1]))


def _scaled(wave: Waveform, axis: AxisModel, size: float, time: float) -> Waveform:
    sized = Scaled(wave, size * _half_range(axis) / REFERENCE_VOLTAGE, time)
    if not _unipolar(axis):
        return sized
    lower, upper = axis.hysteresis.forward.drive_range
    return Raised(sized, 0.5 * (upper + lower), RISE * time)


def _half_range(axis: AxisModel) -> float:
    """Largest voltage to both sides of the middle of the drive."""
    lower, upper = axis.hysteresis.forward.drive_range
    return 0.5 * (upper - lower) if _unipolar(axis) else min(-lower, upper)


def _unipolar(axis: AxisModel) -> bool:
    lower, upper = axis.hysteresis.forward.drive_range
    least, largest = sorted((-lower, upper), key=abs)
    return least < UNIPOLAR * largest


def rest_plan() -> Plan[Waypoints]:
    """No drive for 30 s."""
    nothing = still(30.0, 2e3)
    return Plan("rest", nothing, nothing)


def one_axis_plan() -> Plan[InTurn]:
    """One axis moves while the other rests, x first: a multisine, slow and fast triangles."""
    waves = Multisine(1.0 / RATE, 0.5 * waves_between(4.0, 2000.0, 5_000, RATE, draw=1), 5)
    slow, fast = triangles(LARGE, 1.0, 1, RATE), triangles(1.0, 30.0, 6, RATE)
    moving = InTurn((waves, slow, fast, fading(LARGE, 0.05, RATE)))
    resting = still(moving.total_samples / RATE, RATE)
    return Plan("one_axis", _quiet(moving, resting), _quiet(resting, moving))


def hold_plan() -> Plan[InTurn]:
    """Levels of both signs, each held for a minute, then the same mirrored."""
    return _then_fading("hold", [_held(0.5, -1.0, 2.0)], [_held(2.0, -0.5, -1.0)])


def _held(*levels: float) -> Waypoints:
    """Levels (V) with 0 V and their mirror images, each reached within 0.2 s."""
    stairs = [*levels, 0.0, *(-level for level in levels), 0.0]
    path = [0.0, *(level for stair in stairs for level in (stair, stair))]
    return moves(path, [0.2, 60.0] * len(stairs), SLOW)


def rates_plan() -> Plan[InTurn]:
    """Rounded triangles at 1 to 100 Hz, large and then a tenth as large; y the other way round."""
    cycles = {1.0: 1, 3.0: 2, 10.0: 3, 30.0: 6, 100.0: 10}
    loops = [
        triangles(amplitude, frequency, count, RATE)
        for amplitude in (LARGE, 0.1 * LARGE)
        for frequency, count in cycles.items()
    ]
    return _then_fading("rates", loops, loops[::-1])


def amplitudes_plan() -> Plan[InTurn]:
    """Multisines, 4 Hz to 2 kHz, of 1.5 to 0.1 V about 0 V, then of 0.3 V about ±1.5 V.

    y has phases of its own and goes the other way round.
    """
    x, y = (_sizes(waves_between(4.0, 2000.0, 5_000, RATE, draw)) for draw in (1, 2))
    return _then_fading("amplitudes", x, y[::-1])


def _sizes(wave: Array) -> list[Waveform]:
    """A wave, (1, period), three periods at each of four sizes and about two offsets."""
    sizes = [Multisine(1.0 / RATE, size * wave, 3) for size in np.geomspace(1.5, 0.1, 4)]
    small = evolve(sizes[0], waves=0.3 * wave)
    return [*sizes, *(Together(small, _pedestal(level, small)) for level in (1.5, -1.5))]


def _pedestal(level: float, under: Multisine) -> Waypoints:
    """A level (V) that comes and goes while a wave fades in and out."""
    fade, last = under.period / 2.0, under.total_samples - 1.0
    samples = np.array([0.0, fade, last - fade, last])
    return Waypoints(under.sample_period, np.array([0.0, level, level, 0.0]), samples, fade / 2.0)


def broadband_plan() -> Plan[InTurn]:
    """Small multisines with a line every 10 Hz to 2 kHz, all of one strength."""
    x, y = (
        _quiet(Multisine(1.0 / FAST, 0.5 * waves_between(10.0, 2e3, 5000, FAST, draw, FAST), 12))
        for draw in (1, 2)
    )
    return Plan("broadband", x, y)


def dither_plan() -> Plan[InTurn]:
    """Four slow waves and one of nearly 2 kHz, all of one strength: it shakes the hysteresis.

    A lag weakens the fast wave by (2 pi f lag)²/2 and a delay does not. The scanner hardly follows
    a wave so fast; but how far it shakes changes the slow waves' loops, and these a model knows
    best.
    """
    x, y = (_waves(4, 14, 44, 140, 1980, draw=1), _waves(6, 18, 58, 180, 1940, draw=2))
    return Plan("dither", _quiet(x), _quiet(y))


def _waves(*frequencies: int, draw: int) -> Multisine:
    """Waves of even frequencies (Hz) together, half a second six times."""
    period = round(0.5 * FAST)
    lines = np.array(frequencies) // 2
    phases = np.random.default_rng(draw).random((1, len(frequencies)))
    wave = random_phase_waves(lines, np.ones(len(lines)), period, phases)
    return Multisine(1.0 / FAST, SHAKEN * wave, 6)


def chirp_plan() -> Plan[Chirp]:
    """A sweep that rises in x while it falls in y, 20 Hz to 1 kHz."""
    rising = Chirp(1.0 / RATE, lowest=20.0, seconds=28.0, amplitude=SWEPT, corner=100.0, fade=1.0)
    falling = evolve(rising, lowest=rising.highest, highest=rising.lowest)
    return Plan("chirp", rising, falling)


def stepped_sine_plan() -> Plan[SteppedSine]:
    """Sines in turn, 10 Hz to 1 kHz, close at the resonance; y the other way round."""
    below, near, above = (10.0, 400.0, 10.0), (400.0, 510.0, 3.0), (510.0, 1000.0, 10.0)
    frequencies = np.concatenate([np.arange(*band) for band in (below, near, above)])
    x, y = (
        SteppedSine(order, 1.0 / RATE, amplitude=SWEPT, corner=100.0)
        for order in (frequencies, frequencies[::-1])
    )
    return Plan("stepped_sine", x, y)


def _quiet(*drives: Waveform) -> InTurn:
    rest = still(QUIET, 1.0 / drives[0].sample_period)
    return InTurn((rest, *drives, rest))


def _then_fading(name: str, x: Sequence[Waveform], y: Sequence[Waveform]) -> Plan[InTurn]:
    """What each axis does in turn, then loops that fade, more slowly in y."""
    rate = 1.0 / x[0].sample_period
    x, y = [*x, fading(LARGE, 0.1, rate)], [*y, fading(LARGE, 0.13, rate)]
    return Plan(name, _quiet(*x), _quiet(*y))


EXPERIMENTS = {
    "rest": Experiment(
        rest_plan,
        "no drive: the noise floor, drift, and disturbances that come whether it scans or not",
        stage=False,
    ),
    "one_axis": Experiment(
        one_axis_plan,
        "one axis moves while the other rests: what couples, statically or by a resonance",
    ),
    "hold": Experiment(
        hold_plan,
        "levels of both signs, held: slow creep, which follows the level, from drift,"
        " which does not",
        stage=False,
    ),
    "rates": Experiment(
        rates_plan,
        "the same loops at 1 to 100 Hz, large and small: rate-dependent hysteresis from lag, delay"
        " and a slew limit",
    ),
    "amplitudes": Experiment(
        amplitudes_plan,
        "the same waves at four sizes and about two offsets: hysteretic stiffness, static"
        " nonlinearity, backlash and parameters that moved",
    ),
    "broadband": Experiment(
        broadband_plan,
        "small waves to 2 kHz, all of one strength: further resonances, one that moved, and a delay"
        " from a lag",
    ),
    "dither": Experiment(
        dither_plan,
        "slow waves shaken by a fast one, which a lag weakens and a delay does not: delay from lag",
    ),
    "chirp": Experiment(
        chirp_plan,
        "a sine sweep, also for 'afm-scan identify --frequency' in place of the multisines: its"
        " level distinguishes a bend of the sensor from one of the drive",
    ),
    "stepped_sine": Experiment(
        stepped_sine_plan,
        "one frequency after another, also for 'afm-scan identify --frequency': its level"
        " distinguishes a bend of the sensor from one of the drive",
    ),
}
"""The experiments, by name."""

KINDS: dict[str, Callable[[], Plan[Waveform]]] = {
    **PLANS,
    **{name: experiment.plan for name, experiment in EXPERIMENTS.items()},
}
"""Every record that a scanner can be driven through, by name."""

SWEEPS = ("chirp", "stepped_sine")
"""Those that serve as the frequency record of an identification."""
