"""The linear part of an axis: vibration as a bank of poles, then creep, then the sensor.

    V(s) = Σ_i Re κ_i / (1 - s / p_i),    C(s) = 1 + Σ_j g_j / (1 + s τ_j)

A pole of a mode is complex, that of a lag real. The sensor M(s) is a low-pass of complex poles. The
input is held between samples, and a sample is taken just before the update of the input, so that
displacement k depends on inputs up to k - 1:

    x_i[k + 1] = z_i x_i[k] + (1 - z_i) v[k],    z_i = exp(p_i T),    y[k] = Σ Re κ_i x_i[k]

Sums of states over a stretch of n samples follow from the states at its ends and the inputs:

    (1 - z) Σ x = (1 - z) Σ v + x[0] - x[n]

The same holds for the derivatives d by a pole, of which d[k + 1] = z (d[k] + T (x[k] - v[k])).
"""

from functools import cached_property

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.compiled import regrouped
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.fit.stretches import Edges
from afm_scan_ros.core.types import Array, Complex


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


@frozen(eq=False)
class Response:
    """The response of an axis to inputs v (n,), and V's output alone, both in samples, (n,).

    The axis had settled under the input ``settled`` (V). ``dynamics`` have the sensor within V.
    """

    dynamics: PoleBank
    period: float
    inputs: Array
    settled: float
    fast: Array
    output: Array

    def states(self, edges: Edges) -> States:
        """Means over stretches of what the output's derivatives hold."""
        _, of_lags, of_creep = _decays(self.dynamics, self.period)
        unread, given = np.zeros(len(self.inputs)), (self.settled, self.inputs, edges)
        modes, changes = of_modes(self.dynamics, self.period, *given)
        lags = _of_lags(of_lags, np.zeros(len(of_lags)), *given, unread)
        begun = self.settled * float(self.dynamics.weights.real.sum())
        late = _of_lags(of_creep, np.zeros(len(of_creep)), begun, self.fast, edges, unread)
        return States(modes, changes, lags, late)


def of_modes(
    dynamics: PoleBank, period: float, settled: float, inputs: Array, edges: Edges
) -> tuple[Complex, Complex]:
    """Return means over stretches of the states of complex poles, and of what changes by these."""
    decays, unread = _decays(dynamics, period)[0], np.zeros(len(inputs))
    return _of_modes(decays, dynamics.weights, period, settled, inputs, edges, unread)


def respond(
    dynamics: PoleBank, period: float, inputs: Array, settled: float, late: float = 0.0
) -> Response:
    """Response to inputs (n,), of a scanner that has settled under the input ``settled``.

    The output alone is read ``late`` (s).
    """
    dynamics = dynamics.read()
    modes, lags, creep = _decays(dynamics, period)
    fast, whole, count = np.zeros(len(inputs)), np.array([0, len(inputs)], np.intp), dynamics.modes
    _of_modes(modes, dynamics.weights, period, settled, inputs, whole, fast)
    _of_lags(lags, dynamics.weights[count:].real.copy(), settled, inputs, whole, fast)
    output, begun = fast.copy(), settled * float(dynamics.weights.real.sum())
    _of_lags(creep, dynamics.gains, begun, fast, whole, output)
    response = Response(dynamics, period, inputs, settled, fast, output)
    return evolve(response, output=_read_late(response, late)) if late else response


def _read_late(response: Response, late: float) -> Array:
    """Output (n,) as it was some time (s) before each sample.

    A part f of a sample before t[k] a state is z^(1 - f) x[k - 1] + (1 - z^(1 - f)) v[k - 1].
    """
    dynamics, period, output = response.dynamics, response.period, response.output
    whole, part = divmod(late / period, 1.0)
    samples = int(whole)
    if part:
        samples, decays = samples + 1, np.exp(dynamics.poles * period * (1.0 - part))
        passed = float(np.sum(dynamics.weights * (1.0 - decays)).real)
        weights = dynamics.weights * decays
        later, ends = passed * response.inputs, np.array([0, len(output)], np.intp)
        modes, lags, _ = _decays(dynamics, period)
        given = response.settled, response.inputs, ends, later
        _of_modes(modes, weights, period, *given)
        _of_lags(lags, weights[dynamics.modes :].real.copy(), *given)
        output = output + later - response.fast
    return np.concatenate([np.full(samples, response.output[0]), output])[: len(output)]


def _decays(dynamics: PoleBank, period: float) -> tuple[Complex, Array, Array]:
    """Decay z of a sample, of modes, of lags and of creep."""
    z, count = np.exp(dynamics.poles * period), dynamics.modes
    return z[:count], z[count:].real.copy(), np.exp(-period / dynamics.time_constants)


@regrouped
def _of_modes(
    z: Complex,
    weights: Complex,
    period: float,
    settled: float,
    inputs: Array,
    edges: Edges,
    output: Array,
) -> tuple[Complex, Complex]:
    """Add what modes make of inputs to an output; return means of x and d, (stretches, modes).

    The first of the ``weights`` are those of the modes.
    """
    count, stretches = z.size, edges.size - 1
    states = np.empty((stretches, count), np.complex128)
    changes = np.empty((stretches, count), np.complex128)
    real, imag = z.real.copy(), z.imag.copy()
    shares, turned = weights.real.copy(), weights.imag.copy()
    x, y = np.full(count, settled), np.zeros(count)
    d, e = np.zeros(count), np.zeros(count)
    for s in range(stretches):
        length, driving = edges[s + 1] - edges[s], 0.0
        for i in range(count):
            states[s, i] = complex(x[i], y[i])
            changes[s, i] = complex(d[i], e[i])
        for k in range(edges[s], edges[s + 1]):
            v, total = inputs[k], 0.0
            driving += v
            for i in range(count):
                total += shares[i] * x[i] - turned[i] * y[i]
                a, b = x[i] - v, y[i]
                p, q = d[i] + period * a, e[i] + period * b
                d[i], e[i] = real[i] * p - imag[i] * q, real[i] * q + imag[i] * p
                x[i], y[i] = v + real[i] * a - imag[i] * b, real[i] * b + imag[i] * a
            output[k] += total
        for i in range(count):
            moved = (states[s, i] - complex(x[i], y[i])) / (1.0 - z[i])
            change = changes[s, i] - complex(d[i], e[i]) + z[i] * period * moved
            states[s, i] = (driving + moved) / length
            changes[s, i] = change / (1.0 - z[i]) / length
    return states, changes


@regrouped
def _of_lags(
    z: Array, gains: Array, settled: float, inputs: Array, edges: Edges, output: Array
) -> Array:
    """Add what lags make of inputs to an output; return means of x, (stretches, lags)."""
    count, stretches, driven = z.size, edges.size - 1, 1.0 - z
    states, x = np.empty((stretches, count)), np.full(count, settled)
    for s in range(stretches):
        length, driving = edges[s + 1] - edges[s], 0.0
        for j in range(count):
            states[s, j] = x[j]
        for k in range(edges[s], edges[s + 1]):
            v, total = inputs[k], 0.0
            driving += v
            for j in range(count):
                total += gains[j] * x[j]
                x[j] = z[j] * x[j] + driven[j] * v
            output[k] += total
        for j in range(count):
            states[s, j] = (driving + (states[s, j] - x[j]) / driven[j]) / length
    return states
