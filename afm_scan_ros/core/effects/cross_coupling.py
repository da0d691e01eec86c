"""Cross coupling: one axis moves with the other.

y₀ is the displacement that the other axis makes by its own drive, ω = 2π f and
q(s) = s² + 2 ζ ω s + ω²:

- static: x = x₀ + c y₀. The axes or the sensors are turned or tilted.
- dynamic: x = x₀ + c ω² / q y₀. A structure between the axes resonates, too light to act back.
- modal: x = x₀ + (c + m ω² / q) y₀. One mode, and the share c of all stiffer ones, as of a stage
  that yaws.
- arc: x = x₀ + κ y₀² / 2. The guide of the other axis swings on an arc of the curvature κ and takes
  this axis along, as parallel leaf springs do.
- coupled_mode: x = (d x₀ + c ω₁² ω² / q y₀) / (d + c ω₁² (1 - ω² / q)). A mass on a spring between
  the axes pulls at the first resonance d(s) of this axis, with d(0) = ω₁².

c, m and ζ are dimensionless, κ is in 1/m, f in Hz. Assumption: this axis does not act on the other.
"""

from collections.abc import Iterator

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.coupled_system import SampledCoupling, memoryless
from afm_scan_ros.core.effects.base import Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import (
    CandidateMode,
    ResidualFeatures,
    amounts,
    modes_or_usual,
)
from afm_scan_ros.core.effects.vibration import VibrationModel, first_resonance, held, resonant
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

LIKELY = tuple(CandidateMode(frequency, 0.02) for frequency in (100.0, 300.0, 1000.0))
SHARE = EffectParameter("share", "1", -0.3, 0.3, 1e-6)
FREQUENCY = EffectParameter("frequency", "Hz", 5.0, 2e4, 0.01, neutral=300.0, excited=True)
DAMPING = EffectParameter("damping", "1", 1e-3, 0.7, 1e-5, neutral=0.02)
CURVATURE = EffectParameter("curvature", "1/m", -5e3, 5e3, 0.1)


def by_structure(share: float, structure: VibrationModel, sample_period: float) -> SampledCoupling:
    """Return a share of what a structure makes of the other axis; the states: its, and last sample.

    Between samples the other axis is taken to move straight, so each period drives the structure by
    the mean of its two ends. Raises InputError for a structure with a delay.
    """
    if structure.delay:
        raise InputError("cross_coupling: a structure between the axes cannot have a delay")
    system = held(structure, sample_period)
    half = 0.5 * system.b[:, np.newaxis]
    a = np.block([[system.a, half], [np.zeros((1, len(half) + 1))]])
    seen = share * system.c @ np.hstack((system.a, half))
    direct = 0.5 * share * float(system.c @ system.b)
    return SampledCoupling(a, np.append(half, 1.0), seen, direct, sample_period)


def insert_static(chain: Chain, values: Array) -> Chain:
    """Add a share of the other axis."""
    return chain.with_coupling(Element(memoryless, (*values, 0.0)))


def insert_arc(chain: Chain, values: Array) -> Chain:
    """Let the other axis swing on an arc: curvature (1/m)."""
    return chain.with_coupling(Element(memoryless, (0.0, *values)))


def insert_dynamic(chain: Chain, values: Array) -> Chain:
    """Add a resonance driven by the other axis: share, frequency (Hz), damping."""
    share, frequency, damping = values
    mode = resonant(2.0 * np.pi * frequency, damping)
    return _with_structure(chain, share, VibrationModel(mode[-1:], mode))


def insert_modal(chain: Chain, values: Array) -> Chain:
    """Add a share of the other axis, and a resonance: share, mode's share, frequency, damping."""
    return insert_dynamic(insert_static(chain, values[:1]), values[1:])


def insert_coupled_mode(chain: Chain, values: Array) -> Chain:
    """Put a mass on a spring between the axes: share, frequency (Hz), damping."""
    share, frequency, damping = values
    base, first = chain.model.vibration, first_resonance(chain.model.vibration)
    mode = resonant(2.0 * np.pi * frequency, damping)
    pull = share * first.omega**2 * np.array([*mode[:-1], 0.0])
    coupled = np.polyadd(np.polymul(first.factor, mode), pull)
    loaded = chain.with_vibration(
        numerator=np.polymul(base.numerator, mode), denominator=np.polymul(first.rest, coupled)
    )
    structure = VibrationModel([first.omega**2 * mode[-1]], coupled)
    return _with_structure(loaded, share, structure)


def _with_structure(chain: Chain, share: float, structure: VibrationModel) -> Chain:
    return chain.with_coupling(Element(by_structure, (share, structure)))


def starts_dynamic(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the other axis bends, then where they often lie."""
    for mode in modes_or_usual(features.other, features, LIKELY):
        yield 1e-3, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


def starts_modal(features: ResidualFeatures) -> Iterator[tuple[float, float, float, float]]:
    """The share that the residual holds, beside modes by which the rest bends."""
    (share,) = amounts(features.residual, features.other)
    for start in starts_dynamic(
        evolve(features, residual=features.residual - share * features.other)
    ):
        yield SHARE.nearest(share), *start


def starts_coupled_mode(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """The share that the residual holds: from one near zero a fit goes in a wrong direction."""
    (share,) = amounts(features.residual, features.other)
    for small, frequency, damping in starts_dynamic(features):
        yield max(small, SHARE.nearest(share)), frequency, damping


FORMS = (
    EffectForm("static", ("coupling",), (SHARE,), insert_static, example=(0.05,)),
    EffectForm("arc", ("coupling",), (CURVATURE,), insert_arc, example=(4e3,)),
    EffectForm(
        "dynamic",
        ("coupling",),
        (SHARE, FREQUENCY, DAMPING),
        insert_dynamic,
        starts_dynamic,
        example=(0.05, 300.0, 0.02),
    ),
    EffectForm(
        "modal",
        ("coupling",),
        (SHARE, evolve(SHARE, name="mode_share"), FREQUENCY, DAMPING),
        insert_modal,
        starts_modal,
        example=(0.05, -0.02, 300.0, 0.02),
    ),
    EffectForm(
        "coupled_mode",
        ("vibration", "coupling"),
        (evolve(SHARE, lower=0.0), FREQUENCY, DAMPING),
        insert_coupled_mode,
        starts_coupled_mode,
        example=(0.05, 300.0, 0.05),
    ),
)


@register
def cross_coupling() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="cross_coupling",
        equation="x = x0 + share y0, or x = x0 + curvature y0^2 / 2, or x = x0 + share w^2 / q y0,"
        " q = s^2 + 2 damping w s + w^2, or x = x0 + (share + mode_share w^2 / q) y0, or"
        " x = (d x0 + share d(0) w^2 / q y0) / (d + share d(0) (1 - w^2 / q)), d of the first"
        " resonance",
        needs="motion of the other axis that is no function of this one's, nor of time alone",
        experiment="one_axis",
        remedy="feedforward",
        advice="both axes are decoupled before either is inverted",
        source="Residual of modal analysis: D. J. Ewins, Modal Testing, 2nd ed., Research Studies"
        " Press 2000; arc of a parallel spring guide: S. T. Smith, Flexures, CRC Press 2000.",
        inverse="The displacement that the other axis adds is subtracted from the target. Where"
        " each axis adds to the other, both equations of a sample are solved together. This inverse"
        " can be unstable, for example with sharp resonances of opposite sign. The compensator then"
        " refuses the model before the scan and states the frequency: remove `cross_coupling` from"
        " one axis.",
        confusable=("drift", "extra_resonance", "parameter_shift", "static_nonlinearity"),
        forms=FORMS,
    )
