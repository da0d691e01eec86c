"""What the linear part of an axis makes of every sample of its input, exactly.

Sums of states over a stretch of n samples follow from the states x at its ends and the inputs v:

    (1 - z) Σ x = (1 - z) Σ v + x[0] - x[n]

The same holds for the derivatives d by a pole, of which d[k + 1] = z (d[k] + T (x[k] - v[k])).
"""

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.compiled import regrouped
from afm_scan_ros.core.fit.dynamics import Complex, PoleBank, States
from afm_scan_ros.core.fit.stretches import Edges
from afm_scan_ros.core.types import Array


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
