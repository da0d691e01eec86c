"""Hysteresis by the Preisach model, in the numerical form that needs no differentiation.

Equation: Croft, Shed and Devasia (2001), Eqs. 12 to 17, from the input u (V) to the effective
input F (V). Eq. 17 summed along the staircase is a branch for each link, which starts at the last
extremum (v, f):

    F = f + 2 E(u, v) rising,    F = f - 2 E(v, u) falling

An input that passes the last opposite extremum wipes out both and continues on the branch below.
Assumptions: the hysteresis does not depend on rate, and minor loops between equal inputs are
congruent.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.base import LEVELS, CausalInverse, StatelessEffect, solved
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface, refuse_beyond, rounded_into
from afm_scan_ros.core.effects.hysteresis.walk import BASE, INPUT, OUTPUT, looked_up, walk_copy
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array, floats


def terms(outputs: Array, lower: float, upper: float, count: int) -> Array:
    """What each coefficient is multiplied by at outputs F (V) of shape (n,): shape (n, count)."""
    z = 2.0 * (outputs - lower) / (upper - lower) - 1.0
    inside, order = np.clip(z, -1.0, 1.0), np.arange(count)
    powers = np.polynomial.polynomial.polyvander(inside, count + 1)
    slope = (order + 2) * powers[:, 1:-1] - order % 2
    return np.asarray(powers[:, 2:] - powers[:, order % 2] + slope * (z - inside)[:, np.newaxis])


@frozen
class OutputMap(StatelessEffect):
    """The map of a Preisach operator's output A (V) to the effective input F (V), and back.

    ``coefficients`` are the c_j below, in V. Raises InputError unless it rises
    everywhere between ``lower`` and ``upper`` (V).

        A = F + sum of c_j (z^(j + 2) - z^(j mod 2)),    z = 2 (F - lower) / (upper - lower) - 1

    F (V) is the effective input and A (V) the operator's output; both agree at ``lower`` and
    ``upper``, which fixes the gauge. Beyond these the map goes on straight. A map before the
    operator needs no place of its own: P(h(u)) is a Preisach operator too, E(h(alpha), h(beta)) its
    surface. What a map behind adds is that minor loops between equal inputs need not be congruent.
    So plays between two maps, whose inverse is of that form again, are such an operator exactly.
    Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions, Springer 1996, 2.2 and
    2.4.
    """

    lower: float = field(converter=float)
    upper: float = field(converter=float)
    coefficients: tuple[float, ...] = field(converter=floats)
    _levels: Array = field(init=False, eq=False, repr=False)
    _bent: Array = field(init=False, eq=False, repr=False)

    @_levels.default
    def _spaced(self) -> Array:
        if not self.lower < self.upper or not np.isfinite([self.lower, self.upper]).all():
            raise InputError(f"an output map needs lower < upper: {self.lower}, {self.upper}")
        return np.linspace(self.lower, self.upper, LEVELS)

    @_bent.default
    def _rising(self) -> Array:
        bent, slope = self._bend(self._levels)
        if not slope.min() > 0.0:
            raise InputError(
                "the map behind the hysteresis turns back at an effective input of"
                f" {self._levels[slope.argmin()]:.4g} V, so it has no inverse"
            )
        return bent

    def _bend(self, outputs: Array) -> tuple[Array, Array]:
        """A at outputs F (V), and dA/dF."""
        powers = np.zeros(len(self.coefficients) + 2)
        for j, coefficient in enumerate(self.coefficients):
            powers[j + 2] += coefficient
            powers[j % 2] -= coefficient
        return _bent_by(outputs, self.lower, 0.5 * (self.upper - self.lower), powers)

    def input(self, outputs: Array) -> Array:
        """Operator's outputs A (V) for effective inputs F (V), both (n,)."""
        return self._bend(outputs)[0]

    def slope(self, outputs: Array) -> Array:
        """dA/dF at effective inputs F (V), both (n,)."""
        return self._bend(outputs)[1]

    def output(self, inputs: Array) -> Array:
        """Effective inputs F (V) for the operator's outputs A (V), both (n,)."""
        return solved(self._bend, self._levels, self._bent, inputs)


@compiled
def _bent_by(outputs: Array, lower: float, half: float, powers: Array) -> tuple[Array, Array]:
    """F + p(z) and its slope, p being a polynomial that goes on straight beyond -1 and 1."""
    bent, slope = np.empty(outputs.size), np.empty(outputs.size)
    for k in range(outputs.size):
        beyond = (outputs[k] - lower) / half - 1.0
        z = min(max(beyond, -1.0), 1.0)
        value, tilt = 0.0, 0.0
        for power in powers[::-1]:
            tilt = tilt * z + value
            value = value * z + power
        tilt /= half
        bent[k] = outputs[k] + value + tilt * half * (beyond - z)
        slope[k] = 1.0 + tilt
    return bent, slope


DEPOLARISING_CYCLES = 200


PAGE = 1024
"""Pairs of a page: a block copies the last page or two, however much lies deeper."""
AT_ONCE = 2**15
"""Samples walked at once: what a processor's cache holds."""


@frozen(eq=False)
class Memory:
    """What the material remembers: the extrema not yet wiped out, and the present pair, ``now``.

    ``pages`` (2, …), the oldest first, hold inputs and outputs (V), a minimum first, the negative
    saturation. Every page but the last holds ``PAGE`` of them.
    """

    pages: tuple[Array, ...]
    now: Array

    @property
    def extrema(self) -> Array:
        """All extrema in one, shape (2, depth)."""
        return np.hstack(self.pages)


def _paged(stack: Array) -> tuple[Array, ...]:
    """Extrema (2, depth) as pages, of which the last holds up to two."""
    if stack.shape[1] <= 2 * PAGE:
        return (stack,)
    cuts = range(PAGE, stack.shape[1] - PAGE, PAGE)
    return tuple(page.copy() for page in np.split(stack, cuts, axis=1))


def depolarising(lower: float, upper: float, bias: float | None = None) -> Array:
    """Inputs at the extrema of an oscillation that decays from both limits to zero, or the nearer.

    With the ``bias`` (V) of an EverettSurface, each swing is shorter than the last by as much.
    Without one, each pair of swings is shorter than the last.
    """
    if bias is None:
        decay = 1.0 - np.arange(DEPOLARISING_CYCLES + 1) / DEPOLARISING_CYCLES
        extrema = np.outer(decay, [upper, lower]).ravel()
    else:
        decay = 1.0 - np.arange(2 * DEPOLARISING_CYCLES + 1) / (2 * DEPOLARISING_CYCLES)
        extrema = decay * np.resize([upper, lower], decay.shape) + bias * decay**2
    return np.asarray(np.clip(extrema, lower, upper))


class Preisach(CausalInverse):
    """Hysteresis of one axis, with its exact inverse; the state of either is the Memory.

    The inverse walks the same stack by output and solves one cell of the surface, so it gives
    back every output in range up to rounding. Samples beyond the surface raise BeyondRangeError.
    """

    def __init__(self, surface: EverettSurface) -> None:
        self.surface = surface
        self._surface = looked_up(surface.values, surface.levels)
        output = surface.output_lower, surface.output_upper
        self._limits = {INPUT: surface.drive_range, OUTPUT: output}

    def saturated(self) -> Memory:
        """Memory after an excursion to the lower limit, which wipes out everything else."""
        now = np.array([self.surface.lower, self.surface.offset])
        return Memory((now[:, np.newaxis],), now)

    def at_rest(self) -> Memory:
        """Memory after an oscillation from both limits that decayed to zero."""
        oscillation = depolarising(self.surface.lower, self.surface.upper, self.surface.bias)
        whole = self.surface.lower, self.surface.upper
        return self._walk(INPUT, self.saturated(), oscillation, whole)[0]

    def apply(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        return self._walk(INPUT, state, block, self._limits[INPUT])

    def invert(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Inputs u (V) that give a block of effective inputs F (V), both (n,)."""
        memory, inputs = self._walk(OUTPUT, state, block, self._limits[OUTPUT])
        self.surface.refuse_other_inputs(inputs)
        return memory, inputs

    def _walk(
        self, given: int, state: Memory, block: Array, limits: tuple[float, float]
    ) -> tuple[Memory, Array]:
        (*deeper, top), now, done = state.pages, state.now, 0
        result = np.empty(len(block))
        # A strided block would have the walk compiled anew, which takes seconds.
        block = rounded_into(np.ascontiguousarray(block), *limits)
        while done < len(block):
            part, outcome = block[done : done + AT_ONCE], result[done : done + AT_ONCE]
            memory = top, bool(deeper)
            stack, now, count = walk_copy(self._surface, limits, given, memory, now, part, outcome)
            done += count
            *new, top = _paged(stack)
            deeper += new
            if count < len(part):
                if not deeper or stack.shape[1] > BASE:
                    refuse_beyond(block, *limits)
                top = np.hstack((deeper.pop(), top))
        return Memory((*deeper, top), now), result


class DirectInverse(CausalInverse):
    """Hysteresis of one axis whose inverse is a Preisach model; the state is that one's Memory.

    The paper's own inverse (Croft, Shed and Devasia 2001, Eqs. 11 to 17), identified from output to
    input: ``surface`` is over F (V), its output is u (V). Samples beyond raise BeyondRangeError.
    """

    def __init__(self, surface: EverettSurface) -> None:
        self._preisach = Preisach(surface)

    def at_rest(self) -> Memory:
        """Memory after a drive u that decayed from both of its limits to zero."""
        surface = self._preisach.surface
        limits = surface.output_lower, surface.output_upper
        oscillation = depolarising(*limits, surface.bias)
        return self._preisach.invert(self._preisach.saturated(), oscillation)[0]

    def apply(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Effective inputs F (V) for a block of inputs u (V), both (n,)."""
        return self._preisach.invert(state, block)

    def invert(self, state: Memory, block: Array) -> tuple[Memory, Array]:
        """Inputs u (V) for a block of effective inputs F (V), both (n,)."""
        return self._preisach.apply(state, block)
