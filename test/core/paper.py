"""The scanner of Croft, Shed and Devasia (2001) as records, with a made-up hysteresis."""

import numpy as np
from attrs import evolve
from scipy.signal import residue

from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.model import (
    AxisModel,
    CreepModel,
    DuhemSlopes,
    EverettSurface,
    HysteresisModel,
    VibrationModel,
)

SENSITIVITY = 8.0e-6  # m/V, the project's assumption

CREEP_X = ((1.0, 0.630, 0.0216, 6.25e-5), (1.0, 0.516, 0.0171, 4.69e-5))  # Eq. 6
CREEP_Y = ((1.0, 0.589, 0.0233, 1.48e-5), (1.0, 0.517, 0.0197, 1.14e-5))  # Eq. 9
VIBRATION_X = ((0.435, 3910.0, 1.21e7, 1.07e14), (1.0, 8980.0, 2.78e7, 7.38e10, 1.55e14))  # Eq. 5


def series(numerator: tuple[float, ...], denominator: tuple[float, ...]) -> CreepModel:
    """Creep of polynomials in descending powers of s, the slowest section last."""
    residues, poles, direct = residue(numerator, denominator)
    order = poles.real.argsort()
    gains = -residues.real / (poles.real * direct[0])
    return CreepModel(gains[order], -1.0 / poles.real[order])


def creep() -> CreepModel:
    """Creep of the x axis."""
    return series(*CREEP_X)


def vibration() -> VibrationModel:
    """Vibration of the x axis, in m/V."""
    numerator, denominator = VIBRATION_X
    return VibrationModel([SENSITIVITY * c for c in numerator], denominator)


def cell_weights(n: int, seed: int) -> np.ndarray:
    """Positive Preisach weights of the (n - 1)² cells, heavy on the diagonal (reversible)."""
    random = np.random.default_rng(seed).uniform(0.2, 1.0, (n - 1, n - 1))
    return np.tril(random) + 2.0 * np.eye(n - 1)


def surface_of(weights: np.ndarray, lower: float, upper: float, output: float) -> EverettSurface:
    """Surface whose E(i, j) is the weight of the cells between, output from -output to output."""
    n = len(weights) + 1
    values = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            values[i, j] = weights[j:i, j:i].sum()
    return EverettSurface(lower, upper, values * output / values[-1, 0], -output)


def axis() -> AxisModel:
    """One axis whose hysteresis takes ±4 V to about ±5.5 V, depolarised 0 V to 0 V.

    The direct surface is another one.
    """
    weights = cell_weights(21, seed=2001)
    forward = surface_of(weights, -4.0, 4.0, 5.5)
    rest = float(Preisach(forward).at_rest().now[1])
    hysteresis = HysteresisModel(
        forward=evolve(forward, offset=forward.offset - rest),
        direct=surface_of(weights, -5.5, 5.5, 4.0),
    )
    return AxisModel(hysteresis, vibration(), creep())


def smooth_target(seed: int, samples: int, height: float) -> np.ndarray:
    """Slow random motion from rest at zero back to rest at zero, |values| ≤ height, shape (n,)."""
    phase = np.linspace(0.0, np.pi, samples)
    tones = np.random.default_rng(seed).uniform(-1.0, 1.0, 4)
    wave = sum(a * np.sin((k + 1) * phase) for k, a in enumerate(tones))
    return height * np.sin(phase) ** 4 * wave / 4.0


CELLS, WIDTH, LIMIT = 12, 0.7, 4.0
RATE, SLOPE, INNER = 0.6, 1.0, 0.7
NODES = WIDTH * (2.0 * (np.arange(CELLS + 3) - 1.0) / CELLS - 1.0)
"""Distances (V) from the centre curve that a cubic spline's coefficients stand for."""


def coleman_hodgdon() -> DuhemSlopes:
    """Coleman and Hodgdon (1986), Eq. 2.1, with f(u) = u: dF = rate |du| (u - F) + inner du.

    Its slopes are linear in F - u, and so exactly a spline with these coefficients.
    """
    flat = np.full(CELLS + 3, SLOPE)
    rising, falling = (np.tile(INNER - way * RATE * NODES, (CELLS + 3, 1)) for way in (1.0, -1.0))
    return DuhemSlopes(-LIMIT, LIMIT, -LIMIT, 0.0, (-WIDTH, WIDTH), flat, rising, falling)
