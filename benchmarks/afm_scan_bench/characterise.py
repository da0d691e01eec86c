"""What a simulated scanner is like, measured on it as one would on a real one.

Hysteresis is measured quasi-statically and freed of creep; the effective input F is displacement
over the polynomials' static gain, as the paper's gauge has it, so that the further modes' share
of the static displacement counts.
"""

from collections.abc import Iterator
from itertools import pairwise, permutations

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.axis import AxisSpec, Dynamics, PlayBank, RationalSpec, highest_peak
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

LIMIT = 4.0  # V, the drive's range in the paper
SMALL = (0.04, 0.2)  # V, amplitudes of the small-signal sinusoids
VANISHING = 1e-6  # V, an amplitude at which the plant is as good as linear
STEPS = 400  # samples of a branch
NOISE_SAMPLES = 100_000
NO_CREEP = RationalSpec((1.0,), (1.0,))


@frozen
class Measurement:
    """One measured property of one axis, with its unit."""

    property: str
    axis: str
    value: float
    unit: str


def measure_plant(spec: PlantSpec, seed: int = 0) -> list[Measurement]:
    """Measure hysteresis, modes, creep and sensor of every axis; ``seed`` sets the noise."""
    found = [
        Measurement(name, axis, value, unit)
        for axis, parts in spec.axes().items()
        for measure in (hysteresis, vibration, creep)
        for name, value, unit in measure(parts)
    ]
    return found + sensor(spec, seed)


def hysteresis(spec: AxisSpec) -> Iterator[tuple[str, float, str]]:
    """Range, loop, incongruency and small-signal behaviour of an axis as (name, value, unit)."""
    virgin = effective_input(spec, branches(0.0, LIMIT, -LIMIT))
    lowest, highest = float(virgin[-1]), float(virgin.max())
    span = highest - lowest
    yield f"effective input at {-LIMIT:g} V", lowest, "V"
    yield f"effective input at {LIMIT:g} V", highest, "V"
    yield "width of the major loop / range", 100.0 * loop_width(spec) / span, "%"
    yield "incongruency of minor loops / range", 100.0 * incongruency(spec) / span, "%"
    still, _ = sinusoidal_gain(spec, VANISHING)
    for amplitude in SMALL:
        gain, lag = sinusoidal_gain(spec, amplitude)
        yield f"gain at +-{amplitude:g} V above vanishing", 100.0 * (gain / still - 1.0), "%"
        yield f"phase lag at +-{amplitude:g} V", np.degrees(lag), "deg"


def vibration(spec: AxisSpec) -> Iterator[tuple[str, float, str]]:
    """Peak over static gain of the polynomials; frequency and relative peak of each mode."""
    known = Dynamics.from_spec(evolve(spec, modes=(), creep=NO_CREEP), 1.0)
    first = highest_peak(spec.vibration)
    yield "first peak / static gain", first / float(abs(known.response(np.zeros(1))[0])), "1"
    for mode in spec.modes:
        alone = Dynamics.from_spec(evolve(spec, modes=(mode,), creep=NO_CREEP), 1.0)
        hertz = mode.frequency * (1.0 + mode.damping * np.linspace(-2.0, 2.0, 4001))
        omega = 2.0 * np.pi * hertz
        height = np.abs(alone.response(omega) - known.response(omega))
        yield "mode beside the polynomials: frequency", float(hertz[height.argmax()]), "Hz"
        yield "mode beside the polynomials / first peak", 100.0 * float(height.max()) / first, "%"


def creep(spec: AxisSpec) -> Iterator[tuple[str, float, str]]:
    """How much further the axis creeps than it moves at once, and its time constants."""
    total = np.polyval(spec.creep.numerator, 0.0) / np.polyval(spec.creep.denominator, 0.0)
    yield "creep after a step / step", 100.0 * (float(total) - 1.0), "%"
    for constant in sorted(-1.0 / np.roots(spec.creep.denominator).real):
        yield "time constant of creep", float(constant), "s"


def sensor(spec: PlantSpec, seed: int) -> list[Measurement]:
    """Noise of the undriven scanner, quantisation included, and the step between readings."""
    rest = np.zeros(NOISE_SAMPLES)
    measured, true = Piezoscanner(spec, 1e-5, seed).advance(Trace(0, 1e-5, rest, rest))
    found = []
    for axis in AXES:
        noise = measured.axis(axis) - true.axis(axis)
        quantum = np.diff(np.unique(measured.axis(axis))).min()
        found += [
            Measurement("noise of the sensor, rms", axis, 1e9 * float(noise.std()), "nm"),
            Measurement("quantum of the sensor", axis, 1e9 * float(quantum), "nm"),
        ]
    return found


def effective_input(spec: AxisSpec, drive: Array) -> Array:
    """Effective input F (V) of a virgin axis for a quasi-static drive (V), both of shape (n,)."""
    bank = PlayBank.from_spec(spec.hysteresis)
    rest = np.zeros(1)
    plain = evolve(spec, modes=(), creep=NO_CREEP)
    gains = [
        Dynamics.from_spec(each, 1.0).response(rest)[0].real
        for each in (evolve(spec, creep=NO_CREEP), plain)
    ]
    effective: Array = bank.apply(bank.relaxed(), drive)[1] * (gains[0] / gains[1])
    return effective


def branches(*corners: float) -> Array:
    """Drive (V) from the first corner (left out) to each of the next in equal steps."""
    steps = [np.linspace(a, b, STEPS + 1)[1:] for a, b in pairwise(corners)]
    return np.concatenate(steps)


def loop_width(spec: AxisSpec) -> float:
    """Largest difference (V) of F between the major loop's branches at equal drive."""
    path = effective_input(spec, branches(-LIMIT, LIMIT, -LIMIT, LIMIT))
    falling, rising = path[STEPS : 2 * STEPS], path[2 * STEPS :]
    return float(np.max(falling[-2::-1] - rising[:-1]))


def incongruency(spec: AxisSpec) -> float:
    """Largest difference (V) in height of minor loops between the same two drives.

    One loop hangs on the rising, the other on the falling branch of the major loop.
    """
    levels = np.linspace(-LIMIT, LIMIT, 17)[1:-1]
    heights = {(first, then): _height(spec, first, then) for first, then in permutations(levels, 2)}
    return max(abs(height - heights[then, first]) for (first, then), height in heights.items())


def _height(spec: AxisSpec, first: float, then: float) -> float:
    beyond = np.copysign(LIMIT, first - then)
    path = effective_input(spec, np.array([beyond, -beyond, first, then, first, then]))
    return float(abs(path[-1] - path[-2]))


def sinusoidal_gain(spec: AxisSpec, amplitude: float) -> tuple[float, float]:
    """Gain (1) and phase lag (rad) of F for a sinusoid of so many volts, once it repeats."""
    turn = 2.0 * np.pi * np.arange(4 * STEPS) / (2 * STEPS)
    path = effective_input(spec, amplitude * np.sin(turn))[2 * STEPS :]
    phasor = np.mean(path * np.exp(-1j * turn[2 * STEPS :])) * 2j / amplitude
    return float(abs(phasor)), float(-np.angle(phasor))
