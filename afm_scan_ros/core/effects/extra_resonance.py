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
of v over each hold, exactly. The pole is p = (j √(1 - ζ²) - ζ) 2π/P, and q is a delay by T. With
z = e^{pT}, r = -(1 - j ζ/√(1 - ζ²)) and c = r (z - 1) / (pT):

    v = u + (1 - q) (Re c - q Re(c z*)) / (1 - 2 q Re z + q² |z|²) u
"""

import math
from collections.abc import Iterator
from itertools import product

import numpy as np
import scipy
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.base import CausalInverse, Element
from afm_scan_ros.core.effects.effect_type import EffectForm, EffectParameter, EffectType, register
from afm_scan_ros.core.effects.residual_features import (
    DAMPINGS,
    CandidateMode,
    ResidualFeatures,
    likely_modes,
)
from afm_scan_ros.core.effects.resonance import (
    first_resonance,
    multiplied,
    resonant,
    with_vibration,
)
from afm_scan_ros.core.effects.vibration import OSCILLATES
from afm_scan_ros.core.types import Array

FREQUENCY = EffectParameter("frequency", "Hz", 20.0, 3e3, 0.01, neutral=1000.0, excited=True)
DAMPING = EffectParameter("damping", "1", 1e-3, 0.2, 1e-5, neutral=0.02)
RINGING = (EffectParameter("period", "s", 0.0, 0.05, 1e-8), evolve(DAMPING, upper=OSCILLATES))
TIMES = 1.0 / (2.0 * np.pi * np.geomspace(FREQUENCY.lower, FREQUENCY.upper, 200))
"""s, as a ringing drive's period over 2π."""
LIKELY = tuple(
    CandidateMode(frequency, 0.02) for frequency in (200.0, 450.0, 900.0, 1500.0, 3000.0)
)
SOUGHT = 5
HEAVY = tuple(CandidateMode(float(frequency), 0.02) for frequency in np.geomspace(300.0, 2000.0, 8))
MASSES = (0.05, 0.1, 0.2, 0.4)
SEEN = 3


def held_ring(period: float, damping: float, sample_period: float) -> tuple[Array, Array]:
    """Numerator and denominator (3,) each in powers of q, from a hold to v's mean over it."""
    if period == 0.0:
        return np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    root = math.sqrt(1.0 - damping**2)
    turn = complex(-damping, root) * 2.0 * np.pi * sample_period / period
    z = np.exp(turn)
    c = complex(-1.0, damping / root) * (z - 1.0) / turn
    denominator = np.array([1.0, -2.0 * z.real, abs(z) ** 2])
    away = np.convolve([1.0, -1.0], [c.real, -(c * z.conjugate()).real])
    return denominator + away, denominator


class RingingDrive(CausalInverse):
    """Second-order lag that rings; the state is the filter's (2,).

    From v to u the numerator's zeros are those of a spline, one of them outside the unit circle:
    its inverse would grow. It is a smooth hump, of which the inverse undoes place and width by the
    parabola through three samples: exact up to second order in ωT, and it never rings. The
    inverse's state is the last four samples of v (V).
    """

    def __init__(self, period: float, damping: float, sample_period: float) -> None:
        self._numerator, self._denominator = held_ring(period, damping, sample_period)
        total = self._numerator.sum()
        mean, square = (self._numerator @ np.arange(3.0) ** power / total for power in (1, 2))
        last = mean**2 + 0.5 * (mean - square)
        weights = np.array([1.0 + mean + last, -mean - 2.0 * last, last])
        self._inverse = np.convolve(self._denominator / total, weights)

    def at_rest(self) -> Array:
        """State of a scanner that has long rested at zero."""
        return np.zeros(2)

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        if not block.size:  # of which lfilter makes up a state
            return state, block
        found, state = scipy.signal.lfilter(self._numerator, self._denominator, block, zi=state)
        return state, found

    def inverse_at_rest(self) -> Array:
        """Four samples before the first, at rest."""
        return np.zeros(4)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        known = np.concatenate((state, block))
        found = np.convolve(known, self._inverse)[4 : len(known)]
        return known[-4:].copy(), found


def _mode(frequency: float, damping: float) -> Array:
    return resonant(2.0 * np.pi * frequency, damping)


def insert_series_mode(chain: Chain, values: Array) -> Chain:
    """Let the sensor's target ride on the stage: mass, frequency (Hz), damping."""
    mass, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    riding = np.polyadd(mode, [mass, 0.0, 0.0])
    return multiplied(chain, np.polymul(base.numerator, riding), np.polymul(base.denominator, mode))


def insert_absorber_mode(chain: Chain, values: Array) -> Chain:
    """Let a mass ride on the stage and act back: mass, frequency (Hz), damping."""
    mass, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    pull = mass * np.polymul([1.0, 0.0, 0.0], mode[1:])
    loaded = np.polymul(first_resonance(base).rest, pull)
    return multiplied(
        chain,
        np.polymul(base.numerator, mode),
        np.polyadd(np.polymul(base.denominator, mode), loaded),
    )


def insert_parallel(chain: Chain, values: Array) -> Chain:
    """Let a mode move beside the others: share at rest, frequency (Hz), damping."""
    share, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    beside = share * base.static_gain * mode[-1] * np.array(base.denominator)
    return with_vibration(
        chain,
        np.polyadd(np.polymul(base.numerator, mode), beside),
        np.polymul(base.denominator, mode),
    )


def insert_drive(chain: Chain, values: Array) -> Chain:
    """Let the drive ring: period (s), damping."""
    return chain.with_drive(Element(RingingDrive, tuple(values)))


def starts_series_mode(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the prediction bends, then where modes often lie."""
    return _starts(_predicted(features), features)


def starts_absorber_mode(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """A tenth of the mass where modes are seen, a range of masses where they often lie.

    A light one hardly moves the resonance that it is to move; a heavy one moves it so far that
    the residual shows the resonance and no mode.
    """
    seen = likely_modes(_predicted(features), features.residual, features.sample_period, SEEN)
    for mass, mode in (*product((0.1,), seen), *product(MASSES, HEAVY)):
        yield mass, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


def starts_parallel(features: ResidualFeatures) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the drive bends, then where modes often lie."""
    return _starts(features.drive, features)


def starts_drive(features: ResidualFeatures) -> Iterator[tuple[float, float]]:
    """For some dampings, the period by which the prediction's ringing reduces the residual most.

    The comparison uses all spectral lines, because a periodic drive has only a few.
    """
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
    found = likely_modes(cause, features.residual, features.sample_period, SOUGHT)
    for mode in (*found, *LIKELY[: SOUGHT - len(found)]):
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
