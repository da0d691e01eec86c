"""The linear part of an axis: vibration as a bank of poles, then creep, then the sensor.

    V(s) = Σ_i Re κ_i / (1 - s / p_i),    C(s) = 1 + Σ_j g_j / (1 + s τ_j)

A pole of a mode is complex, that of a lag real. The sensor M(s) is a low-pass of complex poles. The
input is held between samples, and a sample is taken just before the update of the input, so that
displacement k depends on inputs up to k - 1:

    x_i[k + 1] = z_i x_i[k] + (1 - z_i) v[k],    z_i = exp(p_i T),    y[k] = Σ Re κ_i x_i[k]
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.fit.stretches import Edges
from afm_scan_ros.core.types import Array

Complex = NDArray[np.complex128]


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

    def seen(self, response: "Response") -> tuple[Complex, Complex, Array]:
        """States of V's poles as the sensor reads them: ``Response.modes, changes, lags`` of M x_i.

        Of a pole p, with the poles q of M and their weights κ,

            M(s) / (1 - s / p) = M(p) / (1 - s / p) + Σ_q Re_q κ / (1 - q / p) / (1 - s / q),

        where Re_q is half the sum of a term and of that with q and κ conjugate.
        """
        if not len(self.sensor[0]):
            return response.modes, response.changes, response.lags
        states, count = response.modes[:, self.modes :], self.modes
        x = np.concatenate([response.modes[:, :count], response.lags], axis=1)
        d = np.concatenate([response.changes[:, :count], np.zeros_like(response.lags)], axis=1)
        p = self.poles[:, np.newaxis]
        seen, changes = x * _at(self.sensor, self.poles), d * _at(self.sensor, self.poles)
        for q, weight, state in (
            (*self.sensor, states),
            (*(one.conj() for one in self.sensor), states.conj()),
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


@frozen(eq=False)
class Response:
    """Means of y over blocks, shape (blocks,), and over stretches of what its derivatives hold.

    ``modes`` x_i and ``changes`` ∂x_i/∂p_i, shape (stretches, modes), and ``lags`` x_i (stretches,
    lags) are before the creep; ``late`` (stretches, time constants) is what each creep element
    makes of V's output.
    """

    output: Array
    modes: Complex
    changes: Complex
    lags: Array
    late: Array


def respond(
    dynamics: PoleBank, period: float, inputs: Array, block: int, edges: Edges, settled: float
) -> Response:
    """Response to inputs (n,), of a scanner that has settled under the input ``settled``.

    ``edges`` of the stretches are multiples of ``block``.
    """
    dynamics = dynamics.read()
    z, count = np.exp(dynamics.poles * period), dynamics.modes
    slow = np.exp(-period / dynamics.time_constants)
    modes = z[:count], dynamics.weights[:count]
    lags = z[count:].real.copy(), dynamics.weights[count:].real.copy()
    creep = slow, dynamics.gains
    return Response(*_respond(*modes, *lags, *creep, period, inputs, block, edges, settled))


@compiled
def _respond(  # noqa: PLR0913, PLR0917 - a compiled loop takes arrays, not objects
    z: Complex,
    weights: Complex,
    fast: Array,
    shares: Array,
    slow: Array,
    gains: Array,
    period: float,
    inputs: Array,
    block: int,
    edges: Edges,
    settled: float,
) -> tuple[Array, Complex, Complex, Array, Array]:
    blocks, stretches = inputs.size // block, edges.size - 1
    output, lags, late = (
        np.zeros(blocks),
        np.zeros((stretches, fast.size)),
        np.zeros((stretches, slow.size)),
    )
    modes = np.zeros((stretches, z.size), np.complex128)
    changes = np.zeros((stretches, z.size), np.complex128)
    x, d = np.full(z.size, settled + 0j), np.zeros(z.size, np.complex128)
    lag, c = np.full(fast.size, settled), np.full(slow.size, settled)
    c *= weights.real.sum() + shares.sum()
    for b in range(stretches):
        for k in range(edges[b], edges[b + 1]):
            v, y = inputs[k], 0.0
            for i in range(z.size):
                y += weights[i].real * x[i].real - weights[i].imag * x[i].imag
                modes[b, i] += x[i]
                changes[b, i] += d[i]
                d[i] = z[i] * (d[i] + period * (x[i] - v))
                x[i] = v + z[i] * (x[i] - v)
            for i in range(fast.size):
                y += shares[i] * lag[i]
                lags[b, i] += lag[i]
                lag[i] = v + fast[i] * (lag[i] - v)
            total = y
            for j in range(slow.size):
                total += gains[j] * c[j]
                late[b, j] += c[j]
                c[j] = y + slow[j] * (c[j] - y)
            output[k // block] += total
        share = 1.0 / (edges[b + 1] - edges[b])
        modes[b] *= share
        changes[b] *= share
        lags[b] *= share
        late[b] *= share
    output /= block
    return output, modes, changes, lags, late


class _StretchBank(NamedTuple):
    """A bank by the length of a stretch, of which the complex poles, ``modes`` many, come first.

    The mean over a stretch holds the states before it, the mean of the input and its slope with the
    weights ``of_states``, ``of_input`` and ``of_slope``. After it the states have decayed by ``z``
    towards that mean, and a unit of slope has moved them by ``shifts``.
    """

    z: Complex
    of_states: Complex
    modes: int
    of_input: Array
    of_slope: Array
    shifts: Complex


class StretchFilter:
    """A bank of poles for columns known by their means over stretches, piece by piece.

    Within a stretch of n samples a column is the line of the slope between its neighbours,

        v_j = v + u_j s,    u_j = (j - (n - 1) / 2) / n,    S = Σ_j u_j z^(n - 1 - j),

    which adds (1 - z) S s to the state after the stretch, and -S s / n to the mean of the state.
    Before the first stretch each column had settled at its value in ``settled``.
    """

    def __init__(
        self,
        bank: tuple[Complex, Complex],
        direct: float,
        period: float,
        edges: Edges,
        settled: Array,
    ) -> None:
        some = np.flatnonzero(bank[1])
        order = some[np.argsort(bank[0][some].imag == 0.0, kind="stable")]
        poles, weights = (each[order] for each in bank)
        lengths, self._which = np.unique(np.diff(edges), return_inverse=True)
        samples = lengths[:, np.newaxis]
        mean = np.expm1(poles * period * samples) / (samples * np.expm1(poles * period))
        sums = np.array([_of_slope(np.exp(poles * period), length) for length in lengths])
        self._bank = _StretchBank(
            np.exp(poles * period * samples),
            mean * weights,
            int(np.count_nonzero(poles.imag)),
            direct + np.sum((1.0 - mean) * weights, axis=1).real,
            -np.sum(sums * weights, axis=1).real / lengths,
            -np.expm1(poles * period) * sums,
        )
        middles = np.pad(0.5 * (edges[1:] + edges[:-1]), 1, mode="edge")
        self._shares = np.diff(edges) / np.maximum(middles[2:] - middles[:-2], 1.0)
        self._first, self._before = 0, settled
        self._states = np.zeros((2, len(poles), len(settled)))
        self._states[0] = settled
        self._live = settled != 0.0

    def __call__(self, columns: Array, after: Array | None = None) -> Array:
        """Means of the output for the next piece, both (stretches, columns).

        ``after`` is the row that follows the piece, if any. A column that has been zero so far
        costs nothing.
        """
        before = self._before if self._first else columns[0]
        self._before = columns[-1]
        part = slice(self._first, self._first + len(columns))
        self._first = part.stop
        self._live |= columns.any(axis=0)
        if after is not None:
            self._live |= after != 0.0
        padded = np.vstack([before, columns, columns[-1] if after is None else after])
        given = self._which[part], self._shares[part], self._bank
        if self._live.all():
            return _filtered(padded, *given, *self._states)
        result, states = np.zeros(columns.shape), np.compress(self._live, self._states, axis=2)
        some = np.compress(self._live, padded, axis=1)
        result[:, self._live] = _filtered(some, *given, *states)
        self._states[:, :, self._live] = states
        return result

    def pulled(self, pull: Array) -> tuple[Array, float]:
        """Derivatives of Σ_s pull_s y_s by the inputs of all stretches, and by the settled input.

        y_s is the mean of the output over stretch s; ``pull`` and the first result have the shape
        (stretches,).
        """
        return _pulled(pull, self._which, self._shares, self._bank)


def _of_slope(z: Complex, samples: int) -> Complex:
    """S of poles z, (poles,), in a stretch of so many samples."""
    places = np.arange(samples)[:, np.newaxis]
    line = (places - 0.5 * (samples - 1)) / samples
    return np.asarray(np.sum(line * z ** (samples - 1 - places), axis=0))


@compiled
def _pulled(pull: Array, which: Edges, shares: Array, bank: _StretchBank) -> tuple[Array, float]:
    z, of_states, _, of_input, of_slope, shifts = bank
    result, later = np.zeros(pull.size), np.zeros(z.shape[1], np.complex128)
    for s in range(pull.size - 1, -1, -1):
        kind = which[s]
        total, slope = of_input[kind] * pull[s], of_slope[kind] * pull[s]
        for i in range(z.shape[1]):
            total += ((1.0 - z[kind, i]) * later[i]).real
            slope += (shifts[kind, i] * later[i]).real
            later[i] = z[kind, i] * later[i] + of_states[kind, i] * pull[s]
        result[s] += total
        result[min(s + 1, pull.size - 1)] += shares[s] * slope
        result[max(s - 1, 0)] -= shares[s] * slope
    return result, later.real.sum()


@compiled
def _filtered(
    padded: Array, which: Edges, shares: Array, bank: _StretchBank, real: Array, imag: Array
) -> Array:
    z, of_states, modes, of_input, of_slope, shifts = bank
    stretches, many = padded.shape[0] - 2, padded.shape[1]
    result, slope = np.empty((stretches, many)), np.empty(many)
    for b in range(stretches):
        kind = which[b]
        for c in range(many):
            slope[c] = shares[b] * (padded[b + 2, c] - padded[b, c])
            result[b, c] = of_input[kind] * padded[b + 1, c] + of_slope[kind] * slope[c]
        for i in range(modes):
            tr, ti = of_states[kind, i].real, of_states[kind, i].imag
            zr, zi = z[kind, i].real, z[kind, i].imag
            sr, si = shifts[kind, i].real, shifts[kind, i].imag
            for c in range(many):
                v = padded[b + 1, c]
                xr, xi = real[i, c], imag[i, c]
                result[b, c] += tr * xr - ti * xi
                xr -= v
                real[i, c] = v + zr * xr - zi * xi + sr * slope[c]
                imag[i, c] = zr * xi + zi * xr + si * slope[c]
        for i in range(modes, z.shape[1]):
            tr, zr, sr = of_states[kind, i].real, z[kind, i].real, shifts[kind, i].real
            for c in range(many):
                v, xr = padded[b + 1, c], real[i, c]
                result[b, c] += tr * xr
                real[i, c] = v + zr * (xr - v) + sr * slope[c]
    return result
