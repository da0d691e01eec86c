"""Motion → Bouc's and Wen's hysteresis, of few numbers, which one loop determines.

    F(u) = f(u) + h,    dh = alpha dv - beta |dv| h - gamma dv |h|,    v = u + bend u²

``f`` is a cubic curve: Bouc and Wen's model behind a map of the drive and before one of the output,
each of the lowest order that makes a loop unlike itself turned by half a turn. Coleman's and
Hodgdon's model is that of gamma 0. It is a Duhem operator. Smaller loops follow from these numbers,
where a density of Preisach's leaves them open. Only models of |gamma| ≤ beta dissipate energy.
Sources: T. S. Low and W. Guo, J. Microelectromechanical Systems 4 (1995) 230, Eqs. 1, 2; M. Ismail,
F. Ikhouane and J. Rodellar, Arch. Comput. Methods Eng. 16 (2009) 161, section 3.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen
from scipy.optimize import least_squares

from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.preisach import depolarising
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.grating.motion import spline_basis
from afm_scan_ros.features.images.loops.moving import LinearDynamics, LoopPart, Swept, loop_parts

POWERS = 3
"""Degree of the curve f."""
LOWEST, HIGHEST = (np.log(0.02), -0.4, -1.0), (np.log(50.0), 0.4, 1.0)
"""Least and greatest numbers, for drives scaled to -1 to 1: v grows all the way."""
STARTS = (0.3, 1.0, 3.0)
"""Values of beta from which searches begin."""
PASSES = 3
"""Repetitions of a record until it ends in the state in which it began."""
CELLS = 24
"""Cells of the slopes' splines along either side."""
STEP = 1e-4
"""Change of a number by which a derivative is taken."""
LEAST = 0.01
"""Least slope, over the mean one: no branch reaches where the equation gives less."""
MARGIN = 0.05
"""Share of the range of h by which the slopes reach beyond it."""


@frozen(eq=False)
class BoucWenFit:
    """Numbers and weights (m) of x, x², x³ and h, where x is the drive scaled to -1 to 1.

    The ``numbers`` (3,) are the logarithm of beta, the bend, and gamma over beta. ``lower`` and
    ``upper`` (V) are the drive's range. ``held_out`` (m) is the rms by which parts of the records
    are missed by a fit of the others.
    """

    numbers: Array
    weights: Array
    lower: float
    upper: float
    held_out: float

    @property
    def gain(self) -> float:
        """Displacement over all the drive's range, over that range, m/V."""
        way = np.linspace(-1.0, 1.0, 8 * CELLS)
        loop = np.concatenate([way, way[::-1]] * 2)
        moved = _columns(loop, hysteresis_state(loop, *_physical(self.numbers), 0.0)) @ self.weights
        return float(np.ptp(moved[len(moved) // 2 :])) / (self.upper - self.lower)

    def slopes(self) -> DuhemSlopes:
        """Return the operator from drive (V) to F (V), which is zero at depolarised rest.

        Raises InputError where the output does not grow with the drive, or does not lag behind it.
        """
        if self.weights[-1] >= 0.0:
            raise InputError("the motion shows no loop that dissipates energy")
        half = 0.5 * (self.upper - self.lower)
        curve = np.concatenate([[0.0], self.weights[:POWERS]]) / self.gain
        knots = np.linspace(-1.0, 1.0, 8 * CELLS + 1)
        slope = np.polynomial.polynomial.polyval(knots, np.polynomial.polynomial.polyder(curve))
        least = LEAST * float(slope.mean()) / half
        if least <= 0.0:
            raise InputError("the motion does not grow with the drive")
        widths = self._widths()
        splines = spline_basis(knots, CELLS)
        centre = np.linalg.lstsq(splines, slope / half, rcond=None)[0]
        distance = np.linspace(*widths, 8 * CELLS + 1)
        tables = []
        for way in (1.0, -1.0):
            change = self._change(way, knots, distance) / half
            across = np.linalg.lstsq(splines, change.T, rcond=None)[0].T
            table = np.linalg.lstsq(splines, across, rcond=None)[0]
            tables.append(np.maximum(centre[:, np.newaxis] + table, least))
        lowest = float(np.polynomial.polynomial.polyval(-1.0, curve))
        range_, centre = (self.lower, self.upper), np.maximum(centre, least)
        return _at_rest(DuhemSlopes(*range_, lowest, 0.0, widths, centre, *tables))

    def _change(self, way: float, inputs: Array, distance: Array) -> Array:
        """Change of h (V) with x at all inputs x and distances h (V): (inputs, distances)."""
        beta, bend, gamma = _physical(self.numbers)
        alpha = self.weights[-1] / self.gain
        slope = alpha - gamma * np.sign(alpha) * np.abs(distance) - way * beta * distance
        return np.outer(1.0 + bend * inputs, slope)

    def _widths(self) -> tuple[float, float]:
        """Least and greatest h (V), with a margin."""
        way = np.linspace(-1.0, 1.0, 8 * CELLS)
        loop = np.concatenate([way[len(way) // 2 :], way[::-1], way, way[::-1]])
        found = hysteresis_state(loop, *_physical(self.numbers), 0.0) * self.weights[-1] / self.gain
        beyond = MARGIN * float(np.ptp(found))
        return float(found.min()) - beyond, float(found.max()) + beyond


def _at_rest(slopes: DuhemSlopes) -> DuhemSlopes:
    """Shift the output so that it is zero at rest, after an oscillation that faded."""
    effect = Duhem(slopes)
    fading = depolarising(slopes.lower, slopes.upper, 0.0)
    output = float(effect.apply(effect.at_rest(), fading)[1][-1])
    return evolve(slopes, offset=slopes.offset - output, rest=0.0)


def _physical(numbers: Array) -> tuple[float, float, float]:
    """Beta, twice the bend, and gamma."""
    beta = float(np.exp(numbers[0]))
    return beta, 2.0 * float(numbers[1]), beta * float(numbers[2])


@compiled
def hysteresis_state(inputs: Array, beta: float, bend: float, gamma: float, start: float) -> Array:
    """Value of h for alpha 1 along inputs x (n,), from ``start`` at the first one."""
    result = np.empty(len(inputs))
    x, h = inputs[0], start
    for k in range(len(inputs)):
        step = inputs[k] - x
        if step != 0.0:
            lost = beta * (1.0 + 0.5 * bend * (inputs[k] + x)) * abs(step)
            kept = np.exp(-lost)
            h = kept * h + np.sign(step) * (1.0 - kept) / beta * (1.0 - gamma * abs(h))
        x, result[k] = inputs[k], h
    return result


def _repeated(inputs: Array, numbers: Array) -> Array:
    """Value of h along inputs that begin as they were when they last passed there the same way."""
    moves = np.sign(np.diff(inputs))
    same = np.flatnonzero((inputs[:-1] == inputs[0]) & (moves == moves[0]))
    start, physical = 0.0, _physical(numbers)
    for _ in range(PASSES):
        found = hysteresis_state(inputs, *physical, start)
        start = float(found[same[-1]])
    return hysteresis_state(inputs, *physical, start)


def _columns(inputs: Array, h: Array) -> Array:
    """Powers of inputs x, and h: (n, POWERS + 1)."""
    return np.stack([*(inputs**k for k in range(1, POWERS + 1)), h], axis=1)


@frozen(eq=False)
class _RepeatedMotion:
    """Records whose memory repeats, behind ``dynamics``; drives are from ``lower`` to ``upper``."""

    records: Sequence[Swept]
    dynamics: LinearDynamics
    lower: float
    upper: float

    def rows(self, numbers: Array) -> list[Swept]:
        """Records with the columns of these numbers for areas."""
        result = []
        for one in self.records:
            scale = 2.0 / (self.upper - self.lower)
            inputs = scale * (one.record.drive - self.lower) - 1.0
            columns = _columns(inputs, _repeated(inputs, numbers))
            count = len(one.moved) * one.every
            means = columns[:count].reshape(len(one.moved), one.every, -1).mean(axis=1)
            result.append(evolve(one, areas=means))
        return result

    def solved(self, numbers: Array) -> tuple[Array, Array]:
        """Weights (m) that fit best, and what they miss, each row times its samples' root."""
        whole = LoopPart.together([one.whole(self.dynamics) for one in self.rows(numbers)])
        weights = np.asarray(np.linalg.lstsq(whole.areas, whole.moved, rcond=None)[0], float)
        return weights, whole.moved - whole.areas @ weights

    def held_out(self, numbers: Array, weights: Array) -> float:
        """Rms (m) by which each part is missed by a fit of the others, linearised."""
        parts = loop_parts(self.rows(numbers), self.dynamics)
        jacobians = [part.areas for part in parts]
        for step in STEP * np.eye(len(numbers)):
            changed = loop_parts(self.rows(numbers + step), self.dynamics)
            moved = [
                (b.areas - a.areas) @ weights / STEP for a, b in zip(parts, changed, strict=True)
            ]
            jacobians = [np.column_stack(each) for each in zip(jacobians, moved, strict=True)]
        missed = [part.moved - part.areas @ weights for part in parts]
        squares = sum(_predicted_squares(jacobians, missed))
        return float(np.sqrt(squares / sum(part.samples for part in parts)))


def _predicted_squares(jacobians: Sequence[Array], missed: Sequence[Array]) -> Iterator[float]:
    """Yield the square of what each part misses once the others alone are fitted."""
    size = np.linalg.norm(np.concatenate(jacobians), axis=0)
    scaled = [each / size for each in jacobians]
    gram = sum(each.T @ each for each in scaled)
    moment = sum(each.T @ miss for each, miss in zip(scaled, missed, strict=True))
    for each, miss in zip(scaled, missed, strict=True):
        change = np.linalg.pinv(gram - each.T @ each) @ (moment - each.T @ miss)
        yield float(np.sum((miss - each @ change) ** 2))


def fit_bouc_wen(
    records: Sequence[Swept], dynamics: LinearDynamics, lower: float, upper: float
) -> BoucWenFit:
    """Fit records of repeated motion, of drives from ``lower`` to ``upper`` (V)."""
    motion = _RepeatedMotion(records, dynamics, lower, upper)
    size = float(np.linalg.norm(motion.solved(np.zeros(3))[1]))

    def missed(numbers: Array) -> Array:
        return motion.solved(numbers)[1] / size

    begun = [np.array([np.log(start), 0.0, 0.0]) for start in STARTS]
    found = [least_squares(missed, b, bounds=(LOWEST, HIGHEST), diff_step=1e-3) for b in begun]
    numbers = min(found, key=lambda each: float(each.cost)).x
    weights = motion.solved(numbers)[0]
    return BoucWenFit(numbers, weights, lower, upper, motion.held_out(numbers, weights))
