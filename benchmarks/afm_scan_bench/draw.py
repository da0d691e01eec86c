"""Another scanner of the same make: every parameter drawn afresh."""

import numpy as np
from attrs import evolve

from afm_scan_ros.simulation.axis import (
    AxisSpec,
    HysteresisSpec,
    ModeSpec,
    PlayBank,
    RationalSpec,
    detuned_axis,
    series,
    with_series,
)
from afm_scan_ros.simulation.scanner import PlantSpec

FREQUENCY, CREEP, HYSTERESIS, PEAK = 0.1, 0.2, 0.15, 0.2
"""Largest relative change of resonances, of creep, of the hysteresis and of the further peaks."""

DAMPING, NOISE = (0.7, 1.4), (0.7, 1.4)
"""Smallest and largest factor."""

LIMIT = 4.0  # V; between it and its negative the new hysteresis spans what the old one does


def drawn(spec: PlantSpec, rng: np.random.Generator) -> PlantSpec:
    """Scanner like ``spec`` whose axes and sensor's noise are drawn from ``rng``, one by one.

    It reaches as far as ``spec`` does, and its mechanisms are those of ``spec``.
    """
    x, y = (_axis(axis, rng) for axis in (spec.x, spec.y))
    noise = spec.sensor.noise_rms * rng.uniform(*NOISE)
    return evolve(spec, x=x, y=y, sensor=evolve(spec.sensor, noise_rms=noise))


def _axis(axis: AxisSpec, rng: np.random.Generator) -> AxisSpec:
    frequency, damping = _about(FREQUENCY, rng), rng.uniform(*DAMPING)
    moved = detuned_axis(axis, frequency, damping)
    return evolve(
        moved,
        hysteresis=_hysteresis(axis.hysteresis, rng),
        modes=tuple(_mode(mode, rng) for mode in moved.modes),
        creep=_creep(axis.creep, rng),
    )


def _about(share: float, rng: np.random.Generator) -> float:
    return rng.uniform(1.0 - share, 1.0 + share)


def _mode(mode: ModeSpec, rng: np.random.Generator) -> ModeSpec:
    return ModeSpec(
        mode.frequency * _about(FREQUENCY, rng),
        mode.damping * rng.uniform(*DAMPING),
        mode.relative_peak * _about(PEAK, rng),
    )


def _creep(creep: RationalSpec, rng: np.random.Generator) -> RationalSpec:
    gains, taus = (
        each * rng.uniform(1.0 - CREEP, 1.0 + CREEP, each.size) for each in series(creep)
    )
    return with_series(creep, gains, taus)


def _hysteresis(old: HysteresisSpec, rng: np.random.Generator) -> HysteresisSpec:
    new = evolve(
        old,
        density=old.density * _about(HYSTERESIS, rng),
        decay=old.decay * _about(HYSTERESIS, rng),
        input_quadratic=old.input_quadratic * _about(HYSTERESIS, rng),
        output_quadratic=old.output_quadratic * _about(HYSTERESIS, rng),
    )
    one, two = (_span(evolve(new, gain=gain)) for gain in (1.0, 2.0))
    return evolve(new, gain=1.0 + (_span(old) - one) / (two - one))


def _span(spec: HysteresisSpec) -> float:
    """How far F (V) goes on a virgin scanner's first branches; affine in the gain."""
    bank = PlayBank.from_spec(spec)
    _, (_, highest, lowest) = bank.apply(bank.relaxed(), np.array([0.0, LIMIT, -LIMIT]))
    return float(highest - lowest)
