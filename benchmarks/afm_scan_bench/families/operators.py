"""Five families of rate-independent hysteresis, from a drive (V) to an effective input (V).

None shares code with the product. The plays and the slip elements are Preisach operators whose
inverse is one too. A Preisach measure that varies with the mean of its thresholds has no such
inverse. Bouc-Wen's and Duhem's operators are no Preisach operators: a drive that comes back to an
extremum does not wipe out what was between. A drive may come in blocks: a state, which is never
changed in place, holds all that an operator remembers.
"""

from typing import Any, Protocol

import numpy as np
from attrs import frozen
from scipy.integrate import cumulative_trapezoid

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.types import Array

LIMIT = 4.0
"""V, to either side, of the drive."""
ROUNDING = 1e-12
"""V within which an element counts as loose."""


class Operator(Protocol):
    """A hysteresis that begins depolarised at zero."""

    def at_rest(self) -> Any:  # noqa: ANN401 - each its own
        """State before the first block."""

    def advance(self, state: Any, drive: Array) -> tuple[Any, Array]:  # noqa: ANN401
        """State after a block of drive (V), and its output (V), both (n,)."""


@frozen(eq=False)
class Plays:
    """Plays of thresholds (V) and weights (1) beside the field itself.

    Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, 2.3.
    """

    thresholds: Array
    weights: Array

    def at_rest(self) -> Array:
        """Plays in their middle, (plays,)."""
        return np.zeros(self.thresholds.size)

    def advance(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Field and plays together."""
        after = state.copy()
        return after, drive + _plays(drive, self.thresholds, self.weights, after)


@frozen(eq=False)
class SlipElements:
    """Elasto-slip elements in series with a spring: u = q + sum of stiffness_i times stop_i(q).

    The voltage u is known and the charge q sought. Each element breaks loose at ``breakaway`` (V).
    Source: M. Goldfarb and N. Celanovic, IEEE Control Systems 17 (1997) 69, Eqs. 3 to 6.
    """

    breakaway: Array
    stiffness: Array

    def at_rest(self) -> Array:
        """Forces of the elements, then the charge and the voltage, all in V."""
        return np.zeros(self.breakaway.size + 2)

    def advance(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Charge, in V."""
        after = state.copy()
        moved = _slip(drive, self.breakaway, self.stiffness, after[:-2], after[-2:])
        return after, moved


@frozen
class LorentzianPreisach:
    """The field and relays whose thresholds alpha and -beta each have Cauchy's distribution.

    ``share`` weighs the relays (V); ``coercive`` (V) and ``width`` (V) are the distribution's.
    Source: E. Della Torre, Magnetic Hysteresis, IEEE Press 1999, chapter 2, of such measures.
    """

    share: float
    coercive: float
    width: float

    def at_rest(self) -> Array:
        """Last drive and output (V), the way (1), then an extremum and its output (V) a row."""
        return np.zeros((2, 2))

    def advance(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Field and relays together."""
        levels = np.linspace(-LIMIT, LIMIT, 20_001)
        up = 0.5 + np.arctan((levels - self.coercive) / self.width) / np.pi
        density = 1.0 / (np.pi * self.width * (1.0 + ((levels - self.coercive) / self.width) ** 2))
        both = cumulative_trapezoid(density * up[::-1], levels, initial=0.0)
        after, switched = _relays(drive, up, both, state)
        return after, drive + self.share * switched


@frozen
class BoucWen:
    """x = u - h, dh = alpha du - beta |du| h - gamma du |h|.

    Source: T. S. Low and W. Guo, J. Microelectromechanical Systems 4 (1995) 230, Eqs. 1, 2.
    """

    alpha: float
    beta: float
    gamma: float

    def at_rest(self) -> Array:
        """Return h and the last drive, V."""
        return np.zeros(2)

    def advance(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Follow the differential equation, exactly while the drive rises or falls."""
        after = state.copy()
        return after, drive - _bouc_wen(drive, self.alpha, self.beta, self.gamma, after)


@frozen
class Duhem:
    """dF = rate |du| (slope u - F) + inner du.

    Source: B. D. Coleman and M. L. Hodgdon, Int. J. Engineering Science 24 (1986) 897, Eq. 2.1.
    """

    rate: float
    slope: float
    inner: float

    def at_rest(self) -> Array:
        """Return F and the last drive, V."""
        return np.zeros(2)

    def advance(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """Follow the differential equation, exactly while the drive rises or falls."""
        after = state.copy()
        return after, _duhem(drive, self.rate, self.slope, self.inner, after)


@frozen(eq=False)
class Mapped:
    """An operator between two memoryless maps of powers, F = g(P(h(u))).

    ``before`` and ``behind`` are coefficients of the square and of the cube, 1/V and 1/V^2.
    """

    operator: Operator
    before: tuple[float, float] = (0.0, 0.0)
    behind: tuple[float, float] = (0.0, 0.0)

    def at_rest(self) -> Any:  # noqa: ANN401 - the operator's
        """State of the operator."""
        return self.operator.at_rest()

    def advance(self, state: Any, drive: Array) -> tuple[Any, Array]:  # noqa: ANN401
        """Output behind both maps."""
        after, output = self.operator.advance(state, _powers(drive, self.before))
        return after, _powers(output, self.behind)


def applied(operator: Operator, drive: Array) -> Array:
    """Output (V) of an operator for a whole drive (V) from rest, both (n,)."""
    return operator.advance(operator.at_rest(), drive)[1]


def _powers(value: Array, coefficients: tuple[float, float]) -> Array:
    square, cube = coefficients
    return value + square * value**2 + cube * value**3


@compiled
def _plays(drive: Array, thresholds: Array, weights: Array, positions: Array) -> Array:
    total = np.zeros(drive.size)
    for k in range(drive.size):
        for i in range(thresholds.size):
            low, high = drive[k] - thresholds[i], drive[k] + thresholds[i]
            positions[i] = min(max(positions[i], low), high)
            total[k] += weights[i] * positions[i]
    return total


@compiled
def _slip(
    drive: Array, breakaway: Array, stiffness: Array, forces: Array, charge_and_total: Array
) -> Array:
    """Move the charge from element to element that breaks loose, until the voltages agree."""
    result = np.empty(drive.size)
    charge, total = charge_and_total
    for k in range(drive.size):
        way = 1.0 if drive[k] > total else -1.0
        left = way * (drive[k] - total)
        while left > 0.0:
            stiff, reach = 1.0, np.inf
            for i in range(breakaway.size):
                room = (breakaway[i] - way * forces[i]) / stiffness[i]
                if room > ROUNDING:
                    stiff += stiffness[i]
                    reach = min(reach, room)
            move = min(reach, left / stiff)
            for i in range(breakaway.size):
                room = (breakaway[i] - way * forces[i]) / stiffness[i]
                if room > ROUNDING:
                    forces[i] += way * stiffness[i] * move
            charge += way * move
            left -= stiff * move
            if move < reach:
                break
        total, result[k] = drive[k], charge
    charge_and_total[:] = charge, total
    return result


@compiled
def _between(up: Array, both: Array, alpha: float, beta: float) -> float:
    """Measure of the relays that a rise from beta to alpha switches: twice it moves the output."""
    at_alpha, below = _read(up, alpha), _read(up, beta)
    return _read(up, -beta) * (at_alpha - below) - _read(both, alpha) + _read(both, beta)


@compiled
def _read(table: Array, level: float) -> float:
    place = (level + LIMIT) / (2.0 * LIMIT) * (table.size - 1)
    k = min(max(int(place), 0), table.size - 2)
    return float(table[k] + (place - k) * (table[k + 1] - table[k]))


@compiled
def _relays(drive: Array, up: Array, both: Array, state: Array) -> tuple[Array, Array]:
    """Staircase of extrema; below the first lies the depolarised state, symmetric about zero."""
    count = len(state) - 2
    extrema, outputs = np.zeros(count + drive.size + 1), np.zeros(count + drive.size + 1)
    extrema[:count], outputs[:count] = state[2:, 0], state[2:, 1]
    before, last, way, result = state[0, 0], state[0, 1], state[1, 0], np.empty(drive.size)
    for k in range(drive.size):
        u = drive[k]
        turned = (u - before) * way < 0.0
        if turned:
            extrema[count], outputs[count] = before, last
            count += 1
        if u != before:
            way = np.sign(u - before)
        while count > 1 and way * u >= way * extrema[count - 2]:
            count -= 2
        if count == 1 and abs(u) >= abs(extrema[0]):
            count = 0
        if count == 0:
            result[k] = np.sign(u) * _between(up, both, abs(u), -abs(u))
        else:
            base = extrema[count - 1]
            passed = _between(up, both, max(u, base), min(u, base))
            result[k] = outputs[count - 1] + 2.0 * way * passed
        before, last = u, result[k]
    after = np.zeros((count + 2, 2))
    after[0, 0], after[0, 1], after[1, 0] = before, last, way
    after[2:, 0], after[2:, 1] = extrema[:count], outputs[:count]
    return after, result


@compiled
def _bouc_wen(drive: Array, alpha: float, beta: float, gamma: float, state: Array) -> Array:
    h, before = state
    result = np.empty(drive.size)
    for k in range(drive.size):
        left = drive[k] - before
        while left != 0.0:
            way = np.sign(left)
            # With h's sign fixed, dh/d|u| = way alpha - rate h.
            side = np.sign(h) if h != 0.0 else way
            rate, reach = beta + way * side * gamma, abs(left)
            if h != 0.0 and side != way:
                zero = -np.log(alpha / (alpha + rate * abs(h))) / rate if rate else abs(h) / alpha
                reach = min(reach, zero)
            limit = way * alpha / rate if rate else 0.0
            after = limit + (h - limit) * np.exp(-rate * reach) if rate else h + way * alpha * reach
            if reach < abs(left):
                after = 0.0
            h, left = after, way * (abs(left) - reach)
        before, result[k] = drive[k], h
    state[:] = h, before
    return result


@compiled
def _duhem(drive: Array, rate: float, slope: float, inner: float, state: Array) -> Array:
    f, before = state
    result = np.empty(drive.size)
    for k in range(drive.size):
        move = drive[k] - before
        if move != 0.0:
            way = np.sign(move)
            # F = slope u - way (slope - inner) / rate is the branch that all others tend to.
            lag = way * (slope - inner) / rate
            apart = f - (slope * before - lag)
            f = slope * drive[k] - lag + apart * np.exp(-rate * abs(move))
        before, result[k] = drive[k], f
    state[:] = f, before
    return result
