"""The linear part of an axis: vibration as a bank of poles, then creep, then the sensor.

    V(s) = Σ_i Re κ_i / (1 - s / p_i),    C(s) = 1 + Σ_j g_j / (1 + s τ_j)

A pole of a mode is complex, that of a lag real. The sensor M(s) is a low-pass of complex poles. The
input is held between samples, and a sample is taken just before the update of the input, so that
displacement k depends on inputs up to k - 1:

    x_i[k + 1] = z_i x_i[k] + (1 - z_i) v[k],    z_i = exp(p_i T),    y[k] = Σ Re κ_i x_i[k]
"""

from functools import cached_property

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]


@frozen(eq=False)
class States:
    """Means over stretches of what the derivatives of y hold.

    ``modes`` x_i and ``changes`` ∂x_i/∂p_i, shape (stretches, modes), and ``lags`` x_i (stretches,
    lags) are before the creep; ``late`` (stretches, time constants) is what each creep element
    makes of V's output.
    """

    modes: Complex
    changes: Complex
    lags: Array
    late: Array


@frozen(eq=False)
class PoleBank:
    """Poles (rad/s) with weights κ of unit sum, the complex ones first; creep's gains and τ (s).

    The ``sensor`` has poles and weights as V has, all complex.
    """

    poles: Complex
    weights: Complex
    gains: Array
    time_constants: Array
    sensor: tuple[Complex, Complex]

    @cached_property
    def modes(self) -> int:
        """Number of complex poles."""
        return int(np.count_nonzero(self.poles.imag))

    def read(self) -> "PoleBank":
        """V(s) M(s) in the place of V(s), its own complex poles first."""
        poles, weights = _product((self.poles, self.weights), self.sensor)
        own = np.arange(len(self.poles))
        order = np.concatenate(
            [own[: self.modes], np.arange(len(poles))[len(own) :], own[self.modes :]]
        )
        none = np.zeros(0, complex)
        return evolve(self, poles=poles[order], weights=weights[order], sensor=(none, none))

    def parallel(self) -> tuple[Complex, Complex]:
        """Poles and weights of V(s) C(s) M(s) as one bank."""
        whole = self.read()
        slow = (-1.0 / self.time_constants).astype(complex)
        late = self.gains * _at((whole.poles, whole.weights), slow)
        fast = whole.weights * self._creep(whole.poles)
        return np.concatenate([whole.poles, slow]), np.concatenate([fast, late])

    def seen(self, states: States) -> tuple[Complex, Complex, Array]:
        """``modes, changes, lags`` of V's poles as the sensor reads them: those of M x_i.

        Of a pole p, with the poles q of M and their weights κ,

            M(s) / (1 - s / p) = M(p) / (1 - s / p) + Σ_q Re_q κ / (1 - q / p) / (1 - s / q),

        where Re_q is half the sum of a term and of that with q and κ conjugate.
        """
        if not len(self.sensor[0]):
            return states.modes, states.changes, states.lags
        sensor, count = states.modes[:, self.modes :], self.modes
        x = np.concatenate([states.modes[:, :count], states.lags], axis=1)
        d = np.concatenate([states.changes[:, :count], np.zeros_like(states.lags)], axis=1)
        p = self.poles[:, np.newaxis]
        seen, changes = x * _at(self.sensor, self.poles), d * _at(self.sensor, self.poles)
        for q, weight, state in (
            (*self.sensor, sensor),
            (*(one.conj() for one in self.sensor), sensor.conj()),
        ):
            apart = 1.0 - q / p
            seen += 0.5 * state @ (weight / apart).T
            changes -= 0.5 * state @ (weight * q / (p * apart) ** 2).T
            changes += 0.5 * x * (weight / q / (1.0 - p / q) ** 2).sum(axis=1)
        return seen[:, :count], changes[:, :count], seen[:, count:].real

    def _creep(self, s: Complex) -> Complex:
        late = self.gains / (1.0 + s[:, np.newaxis] * self.time_constants)
        return np.asarray(1.0 + late.sum(axis=1))

    def vibration(self, gain: float) -> VibrationModel:
        """V(s) times a gain (m/V) as polynomials of s."""
        poles = np.concatenate([self.poles, self.poles[: self.modes].conj()])
        halves = np.where(np.arange(len(self.poles)) < self.modes, 0.5, 1.0) * self.weights
        weights = np.concatenate([halves, halves[: self.modes].conj()])
        scale = float(np.exp(np.mean(np.log(np.abs(poles)))))
        scaled = poles / scale
        numerator = np.zeros(len(poles), complex)
        for i, weight in enumerate(weights):
            numerator += -weight * scaled[i] * np.poly(np.delete(scaled, i))
        order = scale ** np.arange(len(poles) + 1)
        return VibrationModel(
            tuple(gain * numerator.real * order[1:]), tuple(np.poly(scaled).real * order)
        )

    def creep(self) -> CreepModel:
        """C(s), without the time constants that have no gain, or one of rounding."""
        some = self.gains > np.finfo(np.float32).eps * self.gains.sum()
        return CreepModel(tuple(self.gains[some]), tuple(self.time_constants[some]))


def _at(bank: tuple[Complex, Complex], s: Complex) -> Complex:
    """Response of a bank at some s (rad/s), (n,)."""
    poles, weights = bank
    one = weights / (1.0 - s[:, np.newaxis] / poles)
    two = weights.conj() / (1.0 - s[:, np.newaxis] / poles.conj())
    return np.asarray(0.5 * (one + two).sum(axis=1))


def _product(
    one: tuple[Complex, Complex], other: tuple[Complex, Complex]
) -> tuple[Complex, Complex]:
    """Poles and weights of the product of two banks; one of no poles lets all pass."""
    if not len(other[0]):
        return one
    weights = np.concatenate([one[1] * _at(other, one[0]), other[1] * _at(one, other[0])])
    return np.concatenate([one[0], other[0]]), weights
