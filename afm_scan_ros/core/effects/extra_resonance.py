"""Extra resonance: a mode of the structure, or of the drive, that the model lacks.

Equations, with G the model's vibration, ω = 2π f and q(s) = s² + 2 ζ ω s + ω²:

- rider, G (1 + m s² / q): what the sensor sees, or the sample, rides on the stage on a spring of
  its own, too light to act back; with m = -1 it is that rider alone which is seen, in series with
  the stage: G (2 ζ ω s + ω²) / q.
- absorber, G d / (d + m s² (2 ζ ω s + ω²) / q): a mass on a spring rides on the stage and acts
  back on its first resonance d(s), as in Den Hartog, Mechanical Vibrations; m is the ratio of it
  to the mass that moves in that.
- parallel, G + g G(0) ω² / q: a second mode moves beside those of G under the same force.
- drive, ω² / q before the hysteresis, P = 2π / ω: the amplifier rings (ringing_drive.py).

Rider, absorber and drive change nothing at rest, a parallel mode adds the share g there: to a
drive far below it, it is a gain and nothing else. m, g and ζ are dimensionless, f is in Hz, P in s.
Assumption: linear. The first three stay one transfer function with G, which the optimal inverse
inverts: a parallel mode as it weighs any G, the others exactly, after G's own inverse.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np
import scipy
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.clues import Clues
from afm_scan_ros.core.effects.entry import Entry, Form, Parameter
from afm_scan_ros.core.effects.modes import DAMPINGS, Mode, likely_modes
from afm_scan_ros.core.effects.resonance import (
    DAMPED,
    first_resonance,
    multiplied,
    resonant,
    with_vibration,
)
from afm_scan_ros.core.effects.ringing_drive import RingingDrive
from afm_scan_ros.core.types import Array

FREQUENCY = Parameter("frequency", "Hz", 20.0, 3e3, 0.01)
DAMPING = Parameter("damping", "1", 1e-3, 0.2, 1e-5)
RINGING = (Parameter("period", "s", 0.0, 0.05, 1e-8), evolve(DAMPING, upper=DAMPED))
TIMES = 1.0 / (2.0 * np.pi * np.geomspace(FREQUENCY.lower, FREQUENCY.upper, 200))
"""s, as a ringing drive's period over 2π."""
LIKELY = tuple(Mode(frequency, 0.02) for frequency in (200.0, 450.0, 900.0, 1500.0, 3000.0))
SOUGHT = 5
HEAVY = tuple(Mode(float(frequency), 0.02) for frequency in np.geomspace(300.0, 2000.0, 8))
MASSES = (0.05, 0.1, 0.2, 0.4)
SEEN = 3


def _mode(frequency: float, damping: float) -> Array:
    return resonant(2.0 * np.pi * frequency, damping)


def insert_rider(chain: Chain, values: Array) -> Chain:
    """Let the sensor's target ride on the stage: mass, frequency (Hz), damping."""
    mass, frequency, damping = values
    base, mode = chain.model.vibration, _mode(frequency, damping)
    riding = np.polyadd(mode, [mass, 0.0, 0.0])
    return multiplied(chain, np.polymul(base.numerator, riding), np.polymul(base.denominator, mode))


def insert_absorber(chain: Chain, values: Array) -> Chain:
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
    ringing, damping = values
    return chain.with_drive(lambda period: RingingDrive(ringing, damping, period))


def starts_rider(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the prediction bends, then where modes often lie."""
    return _starts(_predicted(clues), clues)


def starts_absorber(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """A tenth of the mass where modes are seen, a range of masses where they often lie.

    A light one hardly moves the resonance that it is to move; a heavy one moves it so far that
    the residual shows the resonance and no mode.
    """
    seen = likely_modes(_predicted(clues), clues.residual, clues.sample_period, SEEN)
    for mass, mode in (*product((0.1,), seen), *product(MASSES, HEAVY)):
        yield mass, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


def starts_parallel(clues: Clues) -> Iterator[tuple[float, float, float]]:
    """Modes by which the residual's ratio to the drive bends, then where modes often lie."""
    return _starts(clues.drive, clues)


def starts_drive(clues: Clues) -> Iterator[tuple[float, float]]:
    """For some dampings, the period by which the prediction's ringing leaves least of the residual.

    As spectra, all of them: a drive that repeats has but a few lines to tell a mode by.
    """
    window, period = scipy.signal.windows.hann(len(clues.residual), sym=False), clues.sample_period
    moved, seen = (np.fft.rfft(window * x) for x in (_predicted(clues), clues.residual))
    s = 2j * np.pi * np.fft.rfftfreq(len(window), period)
    for damping in DAMPINGS:
        rings = (1.0 / (1.0 + 2.0 * damping * s * t + (s * t) ** 2) for t in TIMES)
        left = [float(np.linalg.norm(seen - moved * (ring - 1.0))) for ring in rings]
        yield 2.0 * np.pi * float(TIMES[int(np.argmin(left))]), damping


def _predicted(clues: Clues) -> Array:
    return clues.displacement - clues.residual


def _starts(cause: Array, clues: Clues) -> Iterator[tuple[float, float, float]]:
    found = likely_modes(cause, clues.residual, clues.sample_period, SOUGHT)
    for mode in (*found, *LIKELY[: SOUGHT - len(found)]):
        yield 1e-4, FREQUENCY.nearest(mode.frequency), DAMPING.nearest(mode.damping)


ENTRY = Entry(
    name="extra_resonance",
    equation="G (1 + mass s^2 / q), q = s^2 + 2 damping w s + w^2, or"
    " G d / (d + mass s^2 (2 damping w s + w^2) / q), d of G's first resonance, or"
    " G + share G(0) w^2 / q, or before the hysteresis"
    " (period / 2 pi)^2 v'' + damping period / pi v' + v = u",
    needs="a drive with power around the mode's frequency",
    confusable=(
        "cross_coupling",
        "hysteretic_stiffness",
        "parameter_shift",
        "periodic_disturbance",
    ),
    experiment="broadband",
    remedy="feedforward",
    advice="the inverse inverts the mode too; one beside the others needs a longer preview",
    forms=(
        Form(
            "rider",
            (Parameter("mass", "1", -1.0, 0.5, 1e-6), FREQUENCY, DAMPING),
            insert_rider,
            starts_rider,
            (0.0, 1000.0, 0.02),
        ),
        Form(
            "absorber",
            (Parameter("mass", "1", 0.0, 1.0, 1e-6), FREQUENCY, DAMPING),
            insert_absorber,
            starts_absorber,
            (0.0, 1000.0, 0.02),
            becomes=("parameter_shift", "resonance"),
        ),
        Form(
            "parallel",
            (Parameter("share", "1", -0.5, 0.5, 1e-6), FREQUENCY, DAMPING),
            insert_parallel,
            starts_parallel,
            (0.0, 1000.0, 0.02),
            becomes=("parameter_shift", "gain"),
        ),
        Form("drive", RINGING, insert_drive, starts_drive, (0.0, 0.02)),
    ),
)
