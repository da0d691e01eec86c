"""Parameter shift: an effect of the base model has other parameters than when it was identified.

All factors are 1 where nothing has changed:

- gain: k G(s).
- resonance: the first resonance's frequency times one factor and its damping times another, with
  G(0) kept.
- stiffness: k ω² for ω² in the first resonance's s² + 2 ζ ω s + ω². So gain, frequency and damping
  change by 1/k, √k and 1/√k.
- creep: all gains times one factor and all time constants times another.
- hysteresis: F = R(u) + k H(u), with R the reversible part, or the centre curve of a Duhem
  operator, and H the rest.
- polarisation: k F of such an F, gain and memory at once, as a piezo ages or is poled anew.
- warmth: gain and creep at once. A warmer piezo moves further and creeps sooner; heat changes the
  rate of creep far more than its amount.

A coupled structure has another linear response, the same at all amplitudes. Delay and lag count as
such a change there.

Causes: temperature, load, a flexure that cracks, ageing, a sensor or an amplifier adjusted anew.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.effect_type import (
    LINEAR,
    EffectForm,
    EffectParameter,
    EffectType,
    fixed,
    register,
)
from afm_scan_ros.core.effects.vibration import first_resonance, resonant
from afm_scan_ros.core.types import Array


def _factor(name: str, lower: float, upper: float) -> EffectParameter:
    return EffectParameter(name, "1", lower, upper, 1e-6, neutral=1.0)


GAIN = (_factor("factor", 0.5, 2.0),)
RESONANCE = _factor("frequency_factor", 0.7, 1.4), _factor("damping_factor", 0.1, 10.0)
STIFFNESS = (_factor("stiffness_factor", 0.5, 2.0),)
CREEP = _factor("gain_factor", 0.0, 10.0), _factor("time_factor", 0.2, 5.0)
MEMORY = (_factor("memory_factor", 0.0, 3.0),)
POLARISATION = *GAIN, *MEMORY
WARMTH = tuple(
    _factor(name, 1.0 / most, most)
    for name, most in (("factor", 1.25), ("gain_factor", 2.0), ("time_factor", 10.0))
)
"""Heat hastens by far more than it adds."""
MOVED = (1.0, 0.98, 1.02, 0.93, 1.07, 0.86, 1.16, 0.78, 1.28)
"""Starts of the frequency's factor: to both sides, farther apart than a resonance is wide."""
HASTENED = (1.0, 0.3, 3.0)
"""Starts of the factor on creep's time constants."""


def insert_gain(chain: Chain, values: Array) -> Chain:
    """Multiply G by a factor."""
    (factor,) = values
    return chain.with_vibration(numerator=factor * np.array(chain.model.vibration.numerator))


def insert_resonance(chain: Chain, values: Array) -> Chain:
    """Multiply the first resonance's frequency and damping by a factor each."""
    frequency, damping = values
    base, found = chain.model.vibration, first_resonance(chain.model.vibration)
    moved = resonant(frequency * found.omega, damping * found.damping)
    change = np.polymul(found.rest, moved - found.factor)
    denominator = np.polyadd(base.denominator, change)
    numerator = np.array(base.numerator) * (denominator[-1] / base.denominator[-1])
    return chain.with_vibration(numerator=numerator, denominator=denominator)


def insert_stiffness(chain: Chain, values: Array) -> Chain:
    """Multiply the stiffness of the first resonance by a factor, its mass and loss as they were."""
    (stiffness,) = values
    found = first_resonance(chain.model.vibration)
    moved = resonant(stiffness**0.5 * found.omega, stiffness**-0.5 * found.damping)
    return chain.with_vibration(denominator=np.polymul(found.rest, moved))


def insert_creep(chain: Chain, values: Array) -> Chain:
    """Multiply creep's gains and its time constants by a factor each."""
    base = chain.model.creep
    creep = CreepModel(values[0] * np.array(base.gains), values[1] * np.array(base.time_constants))
    return chain.with_model(creep=creep)


def insert_warmth(chain: Chain, values: Array) -> Chain:
    """Multiply G by a factor, creep's gains and its time constants by a factor each."""
    return insert_creep(insert_gain(chain, values[:1]), values[1:])


def insert_hysteresis(chain: Chain, values: Array) -> Chain:
    """Multiply what has memory by a factor, also of the direct inverse: right to first order."""
    (factor,) = values
    base = chain.model.hysteresis
    forward, direct = base.forward.with_share(factor), base.direct.with_share(factor)
    return chain.with_model(hysteresis=evolve(base, forward=forward, direct=direct))


def insert_polarisation(chain: Chain, values: Array) -> Chain:
    """Multiply G by a factor, and what has memory by another."""
    return insert_hysteresis(insert_gain(chain, values[:1]), values[1:])


@register
def parameter_shift() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="parameter_shift",
        equation="factor G, or frequency_factor and damping_factor of G's first resonance, or"
        " stiffness_factor of it, or gain_factor and time_factor of creep, or these and factor G,"
        " or F = R(u) + memory_factor H(u), or this and factor G",
        needs="the drive of its identification: steps for creep, loops for hysteresis, a broad"
        " band for the resonance. For a gain: motion over a known length",
        experiment="broadband",
        remedy="feedforward",
        advice="the extended model is a stopgap: identify the scanner anew, and find what changed"
        " it",
        source="The base model: D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123"
        " (2001) 35. Reversible part: I. D. Mayergoyz, Mathematical Models of Hysteresis, Springer"
        " 1991.",
        inverse="The inverse of the base model with the shifted parameters.",
        confusable=("rate_dependent_hysteresis", "slow_creep"),
        forms=(
            EffectForm("gain", ("vibration",), GAIN, insert_gain, example=(1.05,)),
            EffectForm(
                "resonance",
                ("vibration",),
                RESONANCE,
                insert_resonance,
                fixed(*((factor, 1.0) for factor in MOVED)),
                example=(0.9, 1.5),
            ),
            EffectForm("stiffness", ("vibration",), STIFFNESS, insert_stiffness, example=(0.95,)),
            EffectForm("creep", ("creep",), CREEP, insert_creep, example=(1.5, 0.5)),
            EffectForm(
                "warmth",
                ("vibration", "creep"),
                WARMTH,
                insert_warmth,
                fixed(*((1.0, 1.0, factor) for factor in HASTENED)),
                example=(1.03, 1.5, 0.5),
            ),
            EffectForm("hysteresis", ("hysteresis",), MEMORY, insert_hysteresis, example=(0.8,)),
            EffectForm(
                "polarisation",
                ("vibration", "hysteresis"),
                POLARISATION,
                insert_polarisation,
                example=(0.95, 1.2),
                refines="hysteresis",
            ),
        ),
        feedback=LINEAR,
    )
