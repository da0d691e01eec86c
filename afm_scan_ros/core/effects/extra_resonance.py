"""Extra resonance: a mode of the structure, or of the drive, that the model lacks.

G is the model's vibration, ω = 2π f and q(s) = s² + 2 ζ ω s + ω²:

- series_mode: G (1 + m s² / q). The target of the sensor, or the sample, stands on the stage on a
  spring of its own, too light to act back. With m = -1 only its own motion is measured, in series
  with the stage: G (2 ζ ω s + ω²) / q.
- absorber_mode: G d / (d + m s² (2 ζ ω s + ω²) / q). A mass on a spring stands on the stage and
  acts back on its first resonance d(s). m is the ratio of that mass to the mass that moves in the
  resonance.
- parallel: G + g G(0) ω² / q. A second mode moves beside those of G under the same force.
- drive: (P/2π)² v'' + 2 ζ (P/2π) v' + v = u before the hysteresis. The amplifier rings with the
  period P.

At rest the first two and the drive change nothing. A parallel mode adds the share g there: to a
drive far below its frequency it is a gain. m, g and ζ are dimensionless, f is in Hz, P in s.
Assumption: linear.

Of a ringing drive the hysteresis takes the voltage v as held between updates. So it gets the mean
of v over each hold, as of lti.py, with the pole (j √(1 - ζ²) - ζ) 2π/P.
"""

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
import scipy
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.lti import HeldDrive
from afm_scan_ros.core.effects.residual_features import (
    DAMPINGS,
    CandidateMode,
    ResidualFeatures,
    likely_modes,
    modes_or_usual,
)
from afm_scan_ros.core.effects.vibration import OSCILLATES, first_resonance, resonant
from afm_scan_ros.core.types import Array

FREQUENCY = EffectParameter("frequency", "Hz", 20.0, 3e3, 0.01, neutral=1000.0, excited=True)
DAMPING = EffectParameter("damping", "1", 1e-3, 0.2, 1e-5, neutral=0.02)
RINGING = (EffectParameter("period", "s", 0.0, 0.05, 1e-8), evolve(DAMPING, upper=OSCILLATES))
TIMES = 1.0 / (2.0 * np.pi * np.geomspace(FREQUENCY.lower, FREQUENCY.upper, 200))
"""s, as a ringing drive's period over 2π."""
LIKELY = tuple(
    CandidateMode(frequency, 0.02) for frequency in (200.0, 450.0, 900.0, 1500.0, 3000.0)
)
HEAVY = tuple(CandidateMode(float(frequency), 0.02) for frequency in np.geomspace(300.0, 2000.0, 8))
MASSES = (0.05, 0.1, 0.2, 0.4)
SEEN = 3


def ringing_drive(period: float, damping: float, sample_period: float) -> HeldDrive:
    """Return a drive that rings with a period (s) at a sample period (s)."""
    pole = complex(-damping, math.sqrt(1.0 - damping**2))
    return HeldDrive(pole * 2.0 * np.pi / period if period else -np.inf, sample_period)


def _mode(frequency: float, damping: float) -> Array:
    return resonant(2.0 * np.pi * frequency, damping)


def insert_series_mode(chain: Chain, values: Array) -> Chain:
    """Let the sensor's target ride on the stage: mass, frequency (Hz), damping."""
    mass, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    riding = np.polyadd(mode, [mass, 0.0, 0.0])
    return chain.multiplied(np.polymul(base.numerator, riding), np.polymul(base.denominator, mode))


def insert_absorber_mode(chain: Chain, values: Array) -> Chain:
    """Let a mass ride on the stage and act back: mass, frequency (Hz), damping."""
    mass, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    pull = mass * np.polymul([1.0, 0.0, 0.0], mode[1:])
    loaded = np.polymul(first_resonance(base).rest, pull)
    return chain.multiplied(
        np.polymul(base.numerator, mode),
        np.polyadd(np.polymul(base.denominator, mode), loaded),
    )


def insert_parallel(chain: Chain, values: Array) -> Chain:
    """Let a mode move beside the others: share at rest, frequency (Hz), damping."""
    share, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    beside = share * base.static_gain * mode[-1] * np.array(base.denominator)
    return chain.with_vibration(
        numerator=np.polyadd(np.polymul(base.numerator, mode), beside),
        denominator=np.polymul(base.denominator, mode),
    )


def insert_drive(chain: Chain, values: Array) -> Chain:
    """Let the drive ring: period (s), damping."""
    return chain.with_drive(Element(ringing_drive, tuple(values)))


def starts_series_mode(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the prediction bends, then where modes often lie."""
    return _starts(_predicted(features), features)


def starts_absorber_mode(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """A tenth of the mass where modes are seen, a range of masses where they often lie.

    A heavy one moves the resonance so far that the residual shows it and no mode.
    """
    seen = likely_modes(_predicted(features), features.residual, features.sample_period, SEEN)
    for mass, mode in (*product((0.1,), seen), *product(MASSES, HEAVY)):
        yield mass, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


def starts_parallel(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the drive bends, then where modes often lie."""
    return _starts(features.drive, features)


def starts_drive(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """For some dampings, the period whose ringing reduces the residual most, over all lines."""
    window, period = (
        scipy.signal.windows.hann(len(features.residual), sym=False),
        features.sample_period,
    )
    moved, seen = (np.fft.rfft(window * x) for x in (_predicted(features), features.residual))
    s = 2j * np.pi * np.fft.rfftfreq(len(window), period)
    for damping in DAMPINGS:
        rings = (1.0 / (1.0 + 2.0 * damping * s * t + (s * t) ** 2) for t in TIMES)
        sizes = [float(np.linalg.norm(seen - moved * (ring - 1.0))) for ring in rings]
        yield 2.0 * np.pi * float(TIMES[int(np.argmin(sizes))]), damping


def _predicted(features: ResidualFeatures) -> Array:
    return features.displacement - features.residual


def _starts(cause: Array, features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    for mode in modes_or_usual(cause, features, LIKELY):
        yield 1e-4, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


FORMS = (
    EffectForm(
        "series_mode",
        ("vibration",),
        (EffectParameter("mass", "1", -1.0, 0.5, 1e-6), FREQUENCY, DAMPING),
        insert_series_mode,
        starts_series_mode,
        example=(0.02, 1100.0, 0.03),
    ),
    EffectForm(
        "absorber_mode",
        ("vibration",),
        (EffectParameter("mass", "1", 0.0, 1.0, 1e-6), FREQUENCY, DAMPING),
        insert_absorber_mode,
        starts_absorber_mode,
        example=(0.05, 700.0, 0.05),
    ),
    EffectForm(
        "parallel",
        ("vibration",),
        (EffectParameter("share", "1", -0.5, 0.5, 1e-6), FREQUENCY, DAMPING),
        insert_parallel,
        starts_parallel,
        example=(0.05, 700.0, 0.02),
    ),
    EffectForm("drive", ("drive",), RINGING, insert_drive, starts_drive, example=(2e-3, 0.05)),
)


@register
def extra_resonance() -> EffectType:
    """Describe the effect."""
    return EffectType(
        name="extra_resonance",
        equation="G (1 + mass s^2 / q), q = s^2 + 2 damping w s + w^2, or"
        " G d / (d + mass s^2 (2 damping w s + w^2) / q), d of G's first resonance, or"
        " G + share G(0) w^2 / q, or before the hysteresis"
        " (period / 2 pi)^2 v'' + damping period / pi v' + v = u",
        needs="a drive with power around the mode's frequency",
        experiment="broadband",
        remedy="feedforward",
        advice="the inverse inverts the mode too; one beside the others needs a longer preview",
        source="J. P. Den Hartog, Mechanical Vibrations, 4th ed., McGraw-Hill 1956.",
        inverse="A mode that multiplies the vibration is inverted exactly, behind the optimal"
        " inverse of the model without it. So the modified trajectory stays the one for which the"
        " weight was chosen. The inverse does not pass more near a mode that the model lacks."
        " The response of such an inverse is long, but it looks no further ahead. A parallel mode"
        " is inverted by the optimal inverse, which may need a longer preview; the compensator"
        " states how long. A ringing drive is inverted by its equation. What the target asks for"
        " above its frequency costs volts that grow with the square of the frequency.",
        confusable=("hysteretic_stiffness", "parameter_shift", "periodic_disturbance"),
        forms=FORMS,
    )
