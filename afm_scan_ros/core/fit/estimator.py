"""All records of an axis → θ, by Gauss-Newton steps on one likelihood.

The mean over a block of n samples of record k is normal about the model's, with the variance

    v_k = s_k² / n + (η a_k)²

of the sensor's noise s_k and of a discrepancy η that is relative to the rms motion a_k. Both are
estimated from the residuals after each step. What is free in each record (its offset, tones, and
creep from before it) is linear and eliminated. The Jacobian holds inputs over blocks, the residual
does not: so a step is approximate, and what it leads to is exact.
"""

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from attrs import define, evolve, field
from numpy.typing import NDArray

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.evidence import best_scales, first_scales
from afm_scan_ros.core.fit.one_state import OneState
from afm_scan_ros.core.fit.parameters import Columns, Layout, Mode
from afm_scan_ros.core.fit.sensitivity import Simulation, jacobian, simulate
from afm_scan_ros.core.fit.signals import Signals, noise_of
from afm_scan_ros.core.fit.tones import find_tones
from afm_scan_ros.core.types import Array

Mask: TypeAlias = NDArray[np.bool_]

VIBRATION = ("lags", "modes")
"""Groups of parameters of V, which can be fitted while the operator is held."""


@define(eq=False)
class AxisFit:
    """A fit under way: θ (``theta``), the ``gain`` (m/V) and η (``discrepancy``, 1).

    ``scales`` are standard deviations of priors. ``remaining`` (nat) is by how much the objective
    would have fallen in the last step, were it quadratic. The gain stays as the first mode leaves
    it, for the operator has one.
    """

    layout: Layout
    records: list[Signals]
    gain: float
    theta: Array
    discrepancy: float = 1.0
    scales: dict[str, float] = field()
    remaining: float = np.inf
    _columns: dict[int, list[Columns]] = field(factory=dict)
    _damping: float = field()
    _last: tuple[Layout, Array, list[Simulation]] | None = None

    @scales.default
    def _first(self) -> dict[str, float]:
        return first_scales(self.layout.settings)

    @_damping.default
    def _least(self) -> float:
        return self.layout.settings.least_damping

    def variance(self, record: Signals) -> float:
        """Variance v_k of the mean of a block, m²."""
        return record.noise**2 / record.block + (self.discrepancy * record.motion) ** 2

    def simulated(self, theta: Array) -> list[Simulation]:
        """Simulate all records; what was simulated last is kept."""
        if self._last is None or self._last[0] is not self.layout or self._last[1] is not theta:
            every = [simulate(self.layout, theta, record) for record in self.records]
            self._last = self.layout, theta, every
        return self._last[2]

    def residuals(self, simulations: Sequence[Simulation]) -> list[Array]:
        """Residuals (m) of the blocks that count, what is free in each record being fitted."""
        result = []
        for record, simulation in zip(self.records, simulations, strict=True):
            left = record.mean - self.gain * simulation.response.output[record.used]
            free = _Free(record, self.layout, self.variance(record))
            result.append(free.without(left))
        return result

    def misfit(self, theta: Array) -> float:
        """Half the weighted sum of squared residuals."""
        pairs = zip(self.records, self.residuals(self.simulated(theta)), strict=True)
        return sum(0.5 * float(left @ left) / self.variance(record) for record, left in pairs)

    def objective(self, theta: Array) -> float:
        """Minus the logarithm of the posterior, but for a constant; infinite where it overflows."""
        precision, mean = self.layout.prior(self.scales, self.theta)
        apart = theta - mean
        try:
            total = self.misfit(theta) + 0.5 * float(apart @ precision @ apart)
        except InputError:  # the map behind the operator turns back
            return np.inf
        return total if np.isfinite(total) else np.inf

    def evidence(self) -> float:
        """Logarithm of the marginal likelihood, by Laplace's approximation, but for a constant."""
        precision, _ = self.layout.prior(self.scales, self.theta)
        matrix, _ = self.normal(with_operator=True)
        volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(matrix + precision)[1]
        of_noise = sum(len(one.mean) * np.log(self.variance(one)) for one in self.records)
        return float(0.5 * (volume - of_noise) - self.objective(self.theta))

    def normal(self, *, with_operator: bool) -> tuple[Array, Array]:
        """H and g of the normal equations H δ = g at θ, shapes (size, size) and (size,).

        Raises ScanError where they overflow.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            matrix, right = self._normal(with_operator=with_operator)
        if not (np.isfinite(matrix).all() and np.isfinite(right).all()):
            raise ScanError("the fit diverged: its operator's response grows without bound")
        return matrix, right

    def _normal(self, *, with_operator: bool) -> tuple[Array, Array]:
        matrix, right = np.zeros((self.layout.size,) * 2), np.zeros(self.layout.size)
        simulations = self.simulated(self.theta)
        lefts = self.residuals(simulations)
        for k, (record, simulation) in enumerate(zip(self.records, simulations, strict=True)):
            pieces = self._pieces_of(k) if with_operator else None
            variance = self.variance(record)
            free = _Free(record, self.layout, variance)
            share = np.zeros((free.columns.shape[1], self.layout.size))
            for rows, one in jacobian(self.layout, self.theta, record, simulation, pieces):
                live = np.flatnonzero(one.any(axis=0))
                columns = self.gain * one[:, live]
                matrix[np.ix_(live, live)] += columns.T @ columns / variance
                right[live] += columns.T @ lefts[k][rows] / variance
                share[:, live] += free.columns[rows].T @ columns / variance
            matrix -= share.T @ np.linalg.solve(free.matrix, share)
        return matrix, right

    def step(self, groups: Sequence[str] = (), *, searching: bool = False) -> float:
        """Take a step of some groups of parameters, or of all; return how far the objective fell.

        Where ``searching``, the scales of the greatest evidence are chosen first. Gains of creep
        are not negative, and an operator's parameters not below its ``lowest``: one that would pass
        its bound stays there for this step.
        """
        parts = self.layout.parts
        groups = groups or tuple(parts)
        matrix, right = self.normal(with_operator=not set(groups) <= set(VIBRATION))
        if searching:
            self.scales = best_scales(self.layout, self.scales, self.theta, matrix, right)
        precision, mean = self.layout.prior(self.scales, self.theta)
        free = np.zeros(self.layout.size, bool)
        for name in groups:
            free[parts[name]] = True
        right = right - precision @ (self.theta - mean)
        lowest = np.full(self.layout.size, -np.inf)
        lowest[: parts["map"].start] = self.layout.operator.lowest
        lowest[parts["creep"]] = 0.0
        lowest -= self.theta
        before, whole = self.objective(self.theta), matrix + precision
        settings = self.layout.settings
        newton = bounded(whole, right, free, lowest)
        self.remaining = float(newton @ right - 0.5 * newton @ whole @ newton)
        for _ in range(settings.most_trials):
            damped = whole + self._damping * np.diag(np.diag(whole))
            move = bounded(damped, right, free, lowest)
            theta = self.theta + move
            fell = before - self.objective(theta)
            share = fell / float(move @ right - 0.5 * move @ whole @ move + 1e-300)
            if share > settings.good_step:
                self._damping = max(0.1 * self._damping, settings.least_damping)
            elif share < settings.poor_step:
                self._damping *= 4.0
            if fell > 0.0:
                self.theta = theta
                return fell
        return 0.0

    def settle(self, steps: int, groups: Sequence[str] = (), *, searching: bool = False) -> None:
        """Take steps until the objective falls no more, weighing the records after each."""
        for _ in range(steps):
            fell = self.step(groups, searching=searching)
            self.cover()
            self.weigh()
            if fell == 0.0 or self.remaining < self.layout.settings.converged:
                break

    def cover(self) -> None:
        """Let the tables of an operator reach as far as its states do."""
        operator = self.layout.operator
        if isinstance(operator, OneState):
            pairs = zip(self.records, self.simulated(self.theta), strict=True)
            states = [simulation.effective - record.drive for record, simulation in pairs]
            before = self.layout.of_operator(self.theta)
            wider, theta = operator.covering(before, np.concatenate(states))
            if wider is not operator:
                self.layout = evolve(self.layout, operator=wider)
                self.theta = np.concatenate([theta, self.theta[len(theta) :]])

    def weigh(self) -> None:
        """Estimate the noise of records whose blocks are samples, and η, from the residuals."""
        excess, motion = 0.0, 0.0
        for k, left in enumerate(self.residuals(self.simulated(self.theta))):
            record = self.records[k]
            if record.block == 1:
                record = self.records[k] = evolve(record, noise=noise_of(left))
            noise = len(left) * record.noise**2 / record.block
            excess += max(float(left @ left) - noise, 0.0)
            motion += len(left) * record.motion**2
        least = float(np.finfo(np.float32).eps)
        self.discrepancy = max(float(np.sqrt(excess / motion)), least)

    def find_tones(self) -> bool:
        """Let sines in the residuals be free in their records; return whether any are new."""
        simulations, before = self.simulated(self.theta), [one.tones for one in self.records]
        for k, left in enumerate(self.residuals(simulations)):
            record = self.records[k]
            motion = self.gain * simulations[k].response.output[record.used]
            given = left, motion, self.discrepancy, record.length
            found = find_tones(*given, self.layout.settings)
            self.records[k] = record.with_tones(found, self.layout.settings.tone_most)
        self.weigh()
        return before != [one.tones for one in self.records]

    def add(self, mode: Mode) -> None:
        """Add a mode."""
        self.layout, self.theta = self.layout.with_mode(self.theta, mode)

    def lay_out(self, layout: Layout) -> None:
        """Take another layout: the operator stays, the linear part begins anew."""
        operator = self.theta[: self.layout.parts["map"].stop]
        self.layout, self.theta = layout, layout.start()
        self.theta[: len(operator)] = operator

    def _pieces_of(self, k: int) -> Iterable[Columns]:
        """∂A/∂(operator) in a record; those of a linear operator are kept."""
        operator, record = self.layout.operator, self.records[k]
        if k in self._columns:
            return self._columns[k]
        theta = self.layout.of_operator(self.theta)
        pieces: Iterable[Columns] = operator.pieces(
            theta, record.drive, record.block, rested=record.rested
        )
        if operator.linear:
            pieces = self._columns[k] = list(pieces)
        return pieces


class _Free:
    """What is free in one record, as linear regressors with their prior."""

    def __init__(self, record: Signals, layout: Layout, variance: float) -> None:
        self.columns = record.regressors(layout.time_constants, layout.settings.creep)
        self._variance = variance
        prior = np.diag([0.0, *np.ones(self.columns.shape[1] - 1)])
        self.matrix = self.columns.T @ self.columns / variance + prior

    def without(self, signal: Array) -> Array:
        """Return a signal without what the regressors explain of it."""
        right = self.columns.T @ signal / self._variance
        return np.asarray(signal - self.columns @ np.linalg.solve(self.matrix, right))


def bounded(matrix: Array, right: Array, free: Mask, lowest: Array) -> Array:
    """Move of the free parameters, none below its lowest, that lowers ½ mᵀHm - gᵀm most.

    All that would pass their bound are held there, and all held that pull away from it are let go,
    while these become fewer; then one at a time, so that this ends.
    Source: J. Kim and H. Park, SIAM J. Sci. Comput. 33 (2011) 3261, section 3.
    """
    move, loose, fewest = np.zeros(len(right)), free.copy(), len(right) + 1
    for _ in range(3 * len(right)):
        held = free & ~loose
        move[held] = lowest[held]
        pull = right[loose] - matrix[np.ix_(loose, held)] @ move[held]
        move[loose] = np.linalg.solve(matrix[np.ix_(loose, loose)], pull)
        wrong = np.flatnonzero((loose & (move < lowest)) | (held & (right - matrix @ move > 0.0)))
        if len(wrong) == 0:
            break
        exchanged = wrong if len(wrong) < fewest else wrong[-1:]
        fewest = min(fewest, len(wrong))
        loose[exchanged] = ~loose[exchanged]
    return np.where(free, np.maximum(move, lowest), 0.0)
