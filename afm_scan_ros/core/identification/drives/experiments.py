"""Drives that distinguish effects which look alike in a scan, for an unclear residual.

Each begins at depolarised rest and ends at rest, after large moves by loops that fade. x and y
never move alike, so that the effect of each axis on the other is identifiable as well.
"""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import scipy
from attrs import frozen

from afm_scan_ros.core.effects.scale import REFERENCE_VOLTAGE, scale_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import PLANS, Plan, scaled
from afm_scan_ros.core.identification.drives.waveforms import (
    chirp,
    fading,
    moves,
    multisine,
    raised,
    random_phase_waves,
    stepped_sine,
    still,
    triangles,
    waves_between,
    waypoints,
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

    plan: Callable[[], Plan]
    purpose: str
    stage: bool = True

    def plan_for(
        self, model: ScannerModel, amplitude: float | None = None, duration: float | None = None
    ) -> Plan:
        """Return the drive for the scanner of a model: as large a part of its range.

        An axis that the model lacks rests. Another ``amplitude`` (V) is that of the axis that is
        driven further. Another ``duration`` (s) changes all times.
        """
        plan = self.plan()
        size = 1.0 if amplitude is None else amplitude / (self.amplitude_for(model) or 1.0)
        stretch = 1.0 if duration is None else duration / self.duration_for(model)
        time = stretch * self._time(model)
        period = time * plan.sample_period
        x, y = (
            _scaled(wave, model.axis(name), size, time, period)
            if name in model.axes
            else np.zeros_like(wave)
            for name, wave in (("x", plan.x), ("y", plan.y))
        )
        return Plan(plan.name, period, x, y)

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
def _own_peak(plan: Callable[[], Plan]) -> float:
    return peak(plan())


def peak(plan: Plan) -> float:
    """Largest voltage of a drive about 0 V."""
    return max(float(np.abs(wave).max()) for wave in (plan.x, plan.y))


def resized(plan: Plan, amplitude: float | None, duration: float | None) -> Plan:
    """Return a drive about 0 V with another ``amplitude`` (V) or ``duration`` (s), where given."""
    if amplitude is None and duration is None:
        return plan
    size = 1.0 if amplitude is None else amplitude / (peak(plan) or 1.0)
    time = 1.0 if duration is None else duration / plan.duration
    return scaled(plan, size, time)


def resampled(plan: Plan, rate: float) -> Plan:
    """Return a drive at ``rate`` samples a second.

    Raises InputError where more than ``TOO_FAST`` of it is faster than half the rate.
    """
    return Plan(plan.name, 1.0 / rate, *(_resampled(plan, wave, rate) for wave in (plan.x, plan.y)))


def _resampled(plan: Plan, drive: Array, rate: float) -> Array:
    power = np.abs(np.fft.rfft(drive - drive.mean())) ** 2
    frequency = np.fft.rfftfreq(len(drive), plan.sample_period)
    remaining = np.sqrt(np.cumsum(power[::-1])[::-1])
    needed = (
        2.0 * frequency[np.sum(remaining > TOO_FAST * remaining[0]) - 1] if remaining[0] else 0.0
    )
    if rate < (1.0 - 1e-5) * needed:  # as the message rounds it
        raise InputError(
            f"{plan.name}: {rate:.6g} samples a second are too few for this drive: give at least"
            f" {needed:.6g}, or another experiment"
        )
    before = plan.sample_period * np.arange(len(drive))
    after = np.arange(0.0, before[-1], 1.0 / rate)
    values = scipy.interpolate.make_interp_spline(before, drive, k=3)(after)
    return np.append(values, drive[-1])


def _scaled(wave: Array, axis: AxisModel, size: float, time: float, period: float) -> Array:
    sized = size * _half_range(axis) / REFERENCE_VOLTAGE * wave
    if not _unipolar(axis):
        return sized
    lower, upper = axis.hysteresis.forward.drive_range
    return raised(sized, period, 0.5 * (upper + lower), RISE * time)


def _half_range(axis: AxisModel) -> float:
    """Largest voltage to both sides of the middle of the drive."""
    lower, upper = axis.hysteresis.forward.drive_range
    return 0.5 * (upper - lower) if _unipolar(axis) else min(-lower, upper)


def _unipolar(axis: AxisModel) -> bool:
    lower, upper = axis.hysteresis.forward.drive_range
    least, largest = sorted((-lower, upper), key=abs)
    return least < UNIPOLAR * largest


def rest_plan() -> Plan:
    """No drive for 30 s."""
    rate = 2e3
    return Plan("rest", 1.0 / rate, still(30.0, rate), still(30.0, rate))


def one_axis_plan() -> Plan:
    """One axis moves while the other rests, x first: a multisine, slow and fast triangles."""
    waves = multisine(0.5 * waves_between(4.0, 2000.0, 5_000, RATE, draw=1), 5)
    slow, fast = triangles(LARGE, 1.0, 1, RATE), triangles(1.0, 30.0, 6, RATE)
    moving = np.concatenate([waves, slow, fast, fading(LARGE, 0.05, RATE)])
    resting = still(len(moving) / RATE, RATE)
    return _quiet("one_axis", RATE, [moving, resting], [resting, moving])


def hold_plan() -> Plan:
    """Levels of both signs, each held for a minute, then the same mirrored."""
    return _then_fading("hold", SLOW, [_held(0.5, -1.0, 2.0)], [_held(2.0, -0.5, -1.0)])


def _held(*levels: float) -> Array:
    """Levels (V) with 0 V and their mirror images, each reached within 0.2 s."""
    stairs = [*levels, 0.0, *(-level for level in levels), 0.0]
    path = [0.0, *(level for stair in stairs for level in (stair, stair))]
    return moves(path, [0.2, 60.0] * len(stairs), SLOW)


def rates_plan() -> Plan:
    """Rounded triangles at 1 to 100 Hz, large and then a tenth as large; y the other way round."""
    cycles = {1.0: 1, 3.0: 2, 10.0: 3, 30.0: 6, 100.0: 10}
    loops = [
        triangles(amplitude, frequency, count, RATE)
        for amplitude in (LARGE, 0.1 * LARGE)
        for frequency, count in cycles.items()
    ]
    return _then_fading("rates", RATE, loops, loops[::-1])


def amplitudes_plan() -> Plan:
    """Multisines, 4 Hz to 2 kHz, of 1.5 to 0.1 V about 0 V, then of 0.3 V about ±1.5 V.

    y has phases of its own and goes the other way round.
    """
    x, y = (_sizes(waves_between(4.0, 2000.0, 5_000, RATE, draw)) for draw in (1, 2))
    return _then_fading("amplitudes", RATE, x, y[::-1])


def _sizes(wave: Array) -> list[Array]:
    """A wave, (1, period), three periods at each of four sizes and about two offsets.

    An offset comes and goes while the wave fades in and out.
    """
    sizes = [multisine(size * wave, 3) for size in np.geomspace(1.5, 0.1, 4)]
    small, fade = multisine(0.3 * wave, 3), wave.shape[1] / 2.0
    last = len(small) - 1.0
    samples = np.array([0.0, fade, last - fade, last])
    offsets = (np.array([0.0, level, level, 0.0]) for level in (1.5, -1.5))
    return [*sizes, *(small + waypoints(each, samples, fade / 2.0) for each in offsets)]


def broadband_plan() -> Plan:
    """Small multisines with a line every 10 Hz to 2 kHz, all of one strength."""
    x, y = (
        multisine(0.5 * waves_between(10.0, 2e3, 5000, FAST, draw, FAST), 12) for draw in (1, 2)
    )
    return _quiet("broadband", FAST, [x], [y])


def dither_plan() -> Plan:
    """Four slow waves and one of nearly 2 kHz, all of one strength: it shakes the hysteresis.

    A lag weakens the fast wave by (2 pi f lag)²/2 and a delay does not. The scanner hardly follows
    a wave so fast; but how far it shakes changes the slow waves' loops, and these a model knows
    best.
    """
    x, y = (_waves(4, 14, 44, 140, 1980, draw=1), _waves(6, 18, 58, 180, 1940, draw=2))
    return _quiet("dither", FAST, [x], [y])


def _waves(*frequencies: int, draw: int) -> Array:
    """Waves of even frequencies (Hz) together, half a second six times."""
    lines = np.array(frequencies) // 2
    phases = np.random.default_rng(draw).random((1, len(frequencies)))
    wave = random_phase_waves(lines, np.ones(len(lines)), round(0.5 * FAST), phases)
    return multisine(SHAKEN * wave, 6)


def chirp_plan() -> Plan:
    """A sweep that rises in x while it falls in y, 20 Hz to 1 kHz."""
    x, y = (
        chirp(1.0 / RATE, first, last, seconds=28.0, amplitude=SWEPT, corner=100.0, fade=1.0)
        for first, last in ((20.0, 1000.0), (1000.0, 20.0))
    )
    return Plan("chirp", 1.0 / RATE, x, y)


def stepped_sine_plan() -> Plan:
    """Sines in turn, 10 Hz to 1 kHz, close at the resonance; y the other way round."""
    below, near, above = (10.0, 400.0, 10.0), (400.0, 510.0, 3.0), (510.0, 1000.0, 10.0)
    frequencies = np.concatenate([np.arange(*band) for band in (below, near, above)])
    x, y = (
        stepped_sine(order, 1.0 / RATE, dwell=0.25, amplitude=SWEPT, corner=100.0)
        for order in (frequencies, frequencies[::-1])
    )
    return Plan("stepped_sine", 1.0 / RATE, x, y)


def _quiet(name: str, rate: float, *axes: Sequence[Array]) -> Plan:
    """What each axis does in turn, between rests."""
    rest = still(QUIET, rate)
    x, y = (np.concatenate([rest, *each, rest]) for each in axes)
    return Plan(name, 1.0 / rate, x, y)


def _then_fading(name: str, rate: float, x: Sequence[Array], y: Sequence[Array]) -> Plan:
    """What each axis does in turn, then loops that fade, more slowly in y."""
    last = fading(LARGE, 0.1, rate), fading(LARGE, 0.13, rate)
    return _quiet(name, rate, [*x, last[0]], [*y, last[1]])


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

KINDS: dict[str, Callable[[], Plan]] = {
    **PLANS,
    **{name: experiment.plan for name, experiment in EXPERIMENTS.items()},
}
"""Every record that a scanner can be driven through, by name."""

SWEEPS = ("chirp", "stepped_sine")
"""Those that serve as the frequency record of an identification."""
