"""Linear time-invariant systems at one sample period, of which lags and resonances are made.

    x[k+1] = a x[k] + b u[k - delay],    y[k] = c x[k] + d u[k - delay]

A drive of one real or two complex poles p, as of a lag or of an amplifier that rings, settles as
Re c e^{pt} during a hold of length T. The hysteresis takes its voltage as held between updates. So
it gets the mean v over each hold, which is exact for all that is slow beside T. With z = e^{pT} and
m = -(1 + j Re p / Im p) (1 - z) / (pT), or (z - 1) / (pT) for a real pole:

    x[k+1] = z x[k] + (1 - z) u[k],    v[k] = Re(m x[k]) + (1 - Re m) u[k]

Of a lag x is the voltage at the end of the last hold.

SciPy does not filter here: in blocks of 1000 samples ``scipy.signal.sosfilt``
filters half as many samples a second of a vibration as the loop below. The direct form of
``lfilter`` is less exact where poles lie near 1. Of a drive that rings at 500 Hz, sampled at 500
kHz, it errs by 5e-12, and the loop by 5e-14.
"""

import numpy as np
import scipy
from attrs import field, frozen
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import CausalInverse
from afm_scan_ros.core.types import Array


@compiled
def _filter(
    system: tuple[Array, Array, Array, float], state: Array, block: Array
) -> tuple[Array, Array]:
    """State after a block of inputs, and the outputs."""
    a, b, c, d = system
    n, result = state.size, np.empty(block.size)
    both = np.empty((2, n))  # x now and next, in turn
    both[0] = state
    if n == 1:  # in a register, which is half as fast again
        x = state[0]
        for k in range(block.size):
            result[k] = d * block[k] + c[0] * x
            x = b[0] * block[k] + a[0, 0] * x
        both[0, 0] = x
        return both[0].copy(), result
    for k in range(block.size):
        u, now, y = block[k], k % 2, d * block[k]
        for i in range(n):
            y += c[i] * both[now, i]
            x = b[i] * u
            for j in range(n):
                x += a[i, j] * both[now, j]
            both[1 - now, i] = x
        result[k] = y
    return both[block.size % 2].copy(), result


@frozen(eq=False)
class SampledSystem:
    """The system above, with a ``delay`` in samples; the state is x, then the inputs delayed."""

    a: Array = field(converter=np.ascontiguousarray)
    b: Array = field(converter=np.ascontiguousarray)
    c: Array = field(converter=np.ascontiguousarray)
    d: float = field(converter=float)
    sample_period: float
    delay: int = 0

    def at_rest(self) -> Array:
        """State at rest at zero."""
        return np.zeros(len(self.b) + self.delay)

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Outputs for a block of inputs held between samples, both (n,)."""
        system = self.a, self.b, self.c, self.d
        if not self.delay:
            return _filter(system, state, np.ascontiguousarray(block))
        inner, late = np.split(state, [len(self.b)])
        inputs = np.concatenate((late, block))
        after, result = _filter(system, inner, inputs[: len(block)])
        return np.concatenate((after, inputs[len(block) :])), result

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Y/U at angular frequencies ``omega`` in rad/s, same shape."""
        z = np.exp(1j * omega * self.sample_period)
        resolvent = z[:, np.newaxis, np.newaxis] * np.eye(len(self.b)) - self.a
        forcing = np.broadcast_to(self.b[:, np.newaxis], (len(z), len(self.b), 1))
        states = np.linalg.solve(resolvent, forcing)
        result: NDArray[np.complex128] = (self.c.astype(complex) @ states)[:, 0] + complex(self.d)
        late: NDArray[np.complex128] = z**-self.delay
        return result * late


def pole_of(lag: float) -> float:
    """Return the pole (rad/s) of a lag (s)."""
    return -1.0 / lag if lag else -np.inf


def mean_over_holds(pole: complex, sample_period: float) -> SampledSystem:
    """System of gain 1 from a held input to its mean, of a pole (rad/s) or a pair; -inf: none."""
    turn = pole * sample_period
    passed = -np.expm1(turn)
    mean = -passed / turn * (1.0 + 1j * pole.real / pole.imag if pole.imag else 1.0)
    n, z = 2 if pole.imag else 1, 1.0 - passed
    a = np.array([[z.real, -z.imag], [z.imag, z.real]])
    b, c = np.array([passed.real, passed.imag]), np.array([mean.real, -mean.imag])
    return SampledSystem(a[:n, :n], b[:n], c[:n], float(1.0 - mean.real), sample_period)


class HeldDrive(CausalInverse):
    """A drive that settles by a pole (rad/s), or a pair of them, towards each voltage held.

    The state is the system's. From v to u the zeros are those of a spline: one is outside the unit
    circle or near -1, so that the exact inverse would grow, or ring at half the sample rate after
    every kink of v. Its part is a smooth hump, so the inverse takes 1 over the numerator as a power
    series in 1 - q, q being a delay by T, up to the order of the poles. That is exact up to as many
    powers of ωT, and never rings. The inverse's state is the last samples of v (V).
    """

    def __init__(self, pole: complex, sample_period: float) -> None:
        self.system = mean_over_holds(pole, sample_period)
        # In powers of 1 - q, which keep the digits that sums over powers of q lose at slow poles.
        passed, z = complex(*self.system.b), complex(*self.system.a[:, 0])
        mean = complex(*self.system.c).conjugate()
        other = np.conj([passed, z]) if len(self.system.b) > 1 else np.ones(1)
        denominator = np.convolve([passed, z], other).real
        numerator = denominator - np.convolve([0.0, mean], other).real
        series = scipy.signal.lfilter([1.0], numerator, np.eye(len(numerator))[0])
        inverse = Polynomial(np.convolve(denominator, series))
        self._inverse: Array = np.real(inverse(Polynomial([1.0, -1.0])).coef)

    def at_rest(self) -> Array:
        """State of a scanner that has long rested at zero."""
        return self.system.at_rest()

    def apply(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Mean voltage v on the piezo during each hold, for voltages u held, both (n,)."""
        return self.system.apply(state, block)

    def inverse_at_rest(self) -> Array:
        """Samples before the first, at rest."""
        return np.zeros(len(self._inverse) - 1)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Voltages u to hold for mean voltages v, both (n,)."""
        known = np.concatenate((state, block))
        found = np.convolve(known, self._inverse)[len(state) : len(known)]
        return known[len(block) :], found
