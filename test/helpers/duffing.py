"""A resonance with a spring that hardens, integrated by SciPy's solver: no code of the package."""

from collections.abc import Callable

import numpy as np
from attrs import frozen
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from afm_scan_ros.core.types import Array

Force = Callable[[float, float], float]
"""Further force of displacement (m) and speed (m/s), as far as it moves the scanner at rest."""


@frozen
class Oscillator:
    """A scanner of one resonance (rad/s), m/V, whose spring has further parts (1/m, 1/m²).

    ``loss`` (s³/m²) is that of a damper whose force grows with the cube of the speed.
    """

    gain: float = 1e-6
    omega: float = 2.0 * np.pi * 70.0
    damping: float = 0.05
    square: float = 0.0
    cube: float = 0.0
    loss: float = 0.0

    def moved(self, drive: Array, sample_period: float) -> Array:
        """Displacement (m) at the samples of a drive (V) that is smooth between them."""
        time = sample_period * np.arange(len(drive))
        voltage = CubicSpline(time, drive)

        def changed(now: float, state: Array) -> list[float]:
            x, speed = state
            spring = x + self.square * x**2 + self.cube * x**3
            push = self.gain * float(voltage(now)) - spring - self.loss * speed**3
            return [speed, self.omega**2 * push - 2.0 * self.damping * self.omega * speed]

        found = solve_ivp(
            changed, time[[0, -1]], [0.0, 0.0], t_eval=time, rtol=1e-7, atol=1e-13, method="DOP853"
        )
        return np.asarray(found.y[0])


def multisine(count: int, seed: int, share: float = 0.3) -> Array:
    """Waves of one strength up to a share of half the sample rate, rms 1; it begins at rest."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(count // 2 + 1, complex)
    lines = np.arange(3, int(share * count / 2), 2)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    waves = np.fft.irfft(spectrum, count)
    quiet = np.sin(0.5 * np.pi * np.minimum(1.0, np.arange(count) / (0.1 * count))) ** 2
    return np.asarray(quiet * waves / waves.std())
