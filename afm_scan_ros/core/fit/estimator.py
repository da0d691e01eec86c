"""All records of an axis → θ, by Gauss-Newton steps on one likelihood.

The mean over a block of n samples of record k is normal about the model's, with the variance

    v_k = s_k² / n + (η a_k)²

of the sensor's noise s_k and of a discrepancy η that is relative to the rms motion a_k. Both are
estimated from the residuals after each step. What is free in each record (its offset, tones, and
creep from before it) is linear and eliminated. The Jacobian holds inputs over blocks, the residual
does not: so a step is approximate, and what it leads to is exact.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import define, evolve, field
from scipy.optimize import minimize_scalar

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.fit.noise import noise_of
from afm_scan_ros.core.fit.parameters import Columns, Layout, Mode, first_scales
from afm_scan_ros.core.fit.signals import (
    Free,
    Signals,
)
from afm_scan_ros.core.fit.simulation import Simulation, jacobian, pulled, simulate
from afm_scan_ros.core.types import Array


@define(eq=False)
class AxisFit:
    """A fit under way: θ (``theta``), the ``gain`` (m/V) and η (``discrepancy``, 1).

    ``scales`` are standard deviations of priors. ``remaining`` (nat) is by how much the objective
    may still fall: what the last step left of what it would have brought, were the objective
    quadratic. ``quadratic`` is whether it nearly was. The gain stays as the first mode leaves it,
    for the operator has one. Where it ``grows``, slopes of plays are held to their least value.
    ``stalled`` is whether steps have become too short to matter, ``damping_alone`` the damping of
    those of the memories alone.
    """

    layout: Layout
    records: list[Signals]
    gain: float
    theta: Array
    discrepancy: float = 1.0
    scales: dict[str, float] = field()
    remaining: float = np.inf
    quadratic: bool = False
    stalled: bool = False
    grows: bool = False
    damping: float = field()
    damping_alone: float = 1.0
    _columns: dict[int, tuple[Array, list[Columns]]] = field(factory=dict)
    _regressors: dict[int, tuple[object, dict[bool, tuple[Array, Array]]]] = field(factory=dict)
    _last: tuple[Layout, Array, list[Simulation]] | None = None
    _normal: tuple[list[object], tuple[Array, Array]] | None = None

    @scales.default
    def _first(self) -> dict[str, float]:
        return first_scales(self.layout.settings)

    @damping.default
    def _least(self) -> float:
        return self.layout.settings.least_damping

    @property
    def converged(self) -> bool:
        """Whether the parameters were within a third of their standard errors in the mean."""
        return self.remaining < self.near

    @property
    def near(self) -> float:
        """What may remain (nat) of the objective of a fit that has converged."""
        return self.layout.settings.converged * self.layout.size

    @property
    def at_noise(self) -> bool:
        """Whether the discrepancy is a small part of what each record varies by."""
        each = [(one, self.variance(one)) for one in self.records]
        shares = [(self.discrepancy * one.motion) ** 2 / whole for one, whole in each]
        return max(shares) < self.layout.settings.lost

    @property
    def shortest(self) -> float:
        """Time between samples of the fastest record, s."""
        return min(one.sampled for one in self.records)

    @property
    def lags_alone(self) -> bool:
        """Whether lags are all that there is of vibration and sensor."""
        layout = self.layout
        return not (layout.modes or layout.sensor_order or layout.delayed)

    @property
    def hidden_lag(self) -> bool:
        """Whether the mean lag is shorter than any sample, where lags are all that there is.

        What rings between slow samples shows in those behind a step, and looks like such lags.
        """
        return self.lags_alone and self.mean_lag < self.shortest

    @property
    def mean_lag(self) -> float:
        """Mean of the lags, by their weights, s."""
        return float(self.theta[self.layout.parts["lags"]] @ self.layout.lags)

    @property
    def sufficient(self) -> bool:
        """Whether the discrepancy is slight, or a small part of what each record varies by."""
        return self.at_noise or self.discrepancy < self.layout.settings.slight

    def variance(self, record: Signals) -> float:
        """Variance v_k of the mean of a block, m²."""
        return record.noise**2 / record.block + (self.discrepancy * record.motion) ** 2

    def simulated(self, theta: Array) -> list[Simulation]:
        """Simulate all records; what was simulated last is kept."""
        if self._last is None or self._last[0] is not self.layout or self._last[1] is not theta:
            every = [simulate(self.layout, theta, record) for record in self.records]
            self._last = self.layout, theta, every
        return self._last[2]

    def left_of(self, theta: Array, *, gathered: bool) -> Iterator[tuple[Array, Array]]:
        """Yield what the model leaves of each record, and that without what is free in it, m."""
        pairs = zip(self.records, self.simulated(theta), strict=True)
        for k, (record, simulation) in enumerate(pairs):
            left = record.mean - self.gain * simulation.output[record.used]
            left = record.gathered(left) if gathered else left
            yield left, self.free_of(k, gathered=gathered).without(left)

    def residuals(self) -> list[Array]:
        """Residuals (m) of the blocks that count, what is free in each record being fitted."""
        return [residual for _, residual in self.left_of(self.theta, gathered=False)]

    def motions(self) -> list[Array]:
        """Motion (m) of the model in the blocks that count of each record."""
        pairs = zip(self.records, self.simulated(self.theta), strict=True)
        return [self.gain * simulation.output[record.used] for record, simulation in pairs]

    def gathered(self) -> list[Array]:
        """Residuals (m) of the stretches that count, as ``Signals.gathered``."""
        return [residual for _, residual in self.left_of(self.theta, gathered=True)]

    def misfit(self, theta: Array, *, gathered: bool = True) -> float:
        """Half the weighted sum of squared residuals, and of squared weights of what is free.

        These are fitted, so that both together are half of what the model leaves times what remains
        of that. Residuals are those ``gathered`` over stretches, or else of blocks.
        """
        pairs = zip(self.records, self.left_of(theta, gathered=gathered), strict=True)
        return sum(0.5 * float(a @ b) / self.variance(record) for record, (a, b) in pairs)

    def objective(self, theta: Array) -> float:
        """Minus the logarithm of the posterior, but for a constant; infinite where it overflows.

        The residual within stretches counts as constant, since derivatives do not see it.
        """
        precision, mean = self.layout.prior(self.scales, self.theta)
        apart = theta - mean
        try:
            total = self.misfit(theta) + 0.5 * float(apart @ precision @ apart)
            if self.grows:
                total += 0.5 * float(np.sum(self.layout.lacking(theta)[1] ** 2))
        except InputError:  # the map behind the operator turns back, or a mode does not oscillate
            return np.inf
        return total if np.isfinite(total) else np.inf

    def evidence(self) -> float:
        """Logarithm of the marginal likelihood, by Laplace's approximation, but for a constant."""
        precision, _ = self.layout.prior(self.scales, self.theta)
        matrix, _ = self.normal(with_operator=True)
        volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(matrix + precision)[1]
        of_noise = sum(len(one.mean) * np.log(self.variance(one)) for one in self.records)
        within = self.misfit(self.theta, gathered=False) - self.misfit(self.theta)
        return float(0.5 * (volume - of_noise) - self.objective(self.theta) - within)

    def normal(self, *, with_operator: bool) -> tuple[Array, Array]:
        """H and g of the normal equations H δ = g at θ, shapes (size, size) and (size,).

        Those of the last call are kept. Raises ScanError where they overflow.
        """
        at = [self.layout, self.theta, *self.records, (self.gain, self.discrepancy, with_operator)]
        if self._normal is None or not _same(self._normal[0], at):
            self._normal = at, self._normal_at(with_operator=with_operator)
        matrix, right = self._normal[1]
        return matrix.copy(), right.copy()

    def _normal_at(self, *, with_operator: bool) -> tuple[Array, Array]:
        matrix, right = np.zeros((self.layout.size,) * 2), np.zeros(self.layout.size)
        with np.errstate(over="ignore", invalid="ignore"):
            for k, left in enumerate(self.gathered()):
                pieces = self.columns(k, with_operator=with_operator)
                of_record = self.products(k, left, pieces)
                matrix += of_record[0]
                right += of_record[1]
        return _finite(matrix), _finite(right)

    def products(
        self, k: int, left: Array, pieces: Iterable[tuple[slice, Array]]
    ) -> tuple[Array, Array]:
        """H and g of a record of which so much is ``left`` (m), (stretches that count,).

        The derivatives of ``columns`` come in pieces. What is free in the record is eliminated.
        """
        variance, free = self.variance(self.records[k]), self.free_of(k, gathered=True)
        products, right, share = np.zeros((0, 0)), np.zeros(0), np.zeros((0, 0))
        for rows, one in pieces:
            if not len(right):
                size = one.shape[1]
                products, right = np.zeros((size, size)), np.zeros(size)
                share = np.zeros((free.columns.shape[1], size))
            live = np.flatnonzero(one.any(axis=0))
            columns = one[:, live]
            products[np.ix_(live, live)] += columns.T @ columns
            right[live] += columns.T @ left[rows]
            share[:, live] += free.columns[rows].T @ columns
        products -= share.T @ np.linalg.solve(free.matrix, share) / variance
        return np.square(self.gain) / variance * products, self.gain / variance * right

    def columns(self, k: int, *, with_operator: bool) -> Iterator[tuple[slice, Array]]:
        """Yield ∂y/∂θ of a record for a gain of 1, piece by piece: see ``jacobian``."""
        pieces = self.pieces(k) if with_operator else None
        return jacobian(self.simulated(self.theta)[k], pieces)

    def bent(self, move: Array, part: float, *, with_operator: bool) -> Array:
        """Right-hand side g for what the second derivative of the model adds to a move.

        It is taken over a part of the move. Raises InputError where the map behind the operator
        turns back there or a mode does not oscillate, and ScanError where the response overflows.
        """
        ends = [self.simulated(self.theta + way * part * move) for way in (1.0, -1.0)]
        right, here = np.zeros(self.layout.size), self.simulated(self.theta)
        with np.errstate(over="ignore", invalid="ignore"):
            for k, (record, *three) in enumerate(zip(self.records, *ends, here, strict=True)):
                up, down, middle = (one.output[record.used] for one in three)
                variance = self.variance(record)
                added = self.gain * (2.0 * middle - up - down) / part**2
                left = self.free_of(k, gathered=True).without(record.gathered(added))
                pieces = self.pieces(k) if with_operator else None
                pull = self.gain * left / variance
                right += pulled(here[k], pieces, pull[:, np.newaxis])[:, 0]
        return _finite(right)

    def weigh(self) -> None:
        """Estimate the noise of records whose blocks are samples, and η: the likeliest."""
        parts = []
        for k, left in enumerate(self.residuals()):
            record = self.records[k]
            if record.block == record.upsampling:
                noise = np.sqrt(record.upsampling) * noise_of(left, self.layout.settings.finest)
                record = self.records[k] = evolve(record, noise=noise)
            noise = record.noise**2 / record.block
            parts.append((len(left), float(left @ left), noise, record.motion**2))
        count, squares, noise, motion = np.array(parts).T

        def unlikely(logarithm: float) -> float:
            variance = noise + np.exp(2.0 * logarithm) * motion
            return float(np.sum(count * np.log(variance) + squares / variance))

        ends = np.log([np.finfo(np.float32).eps, 1.0 / np.finfo(np.float32).eps])
        self.discrepancy = float(np.exp(minimize_scalar(unlikely, bounds=ends).x))

    def add(self, mode: Mode) -> None:
        """Add a mode."""
        self.layout, self.theta = self.layout.with_mode(self.theta, mode)

    def lay_out(self, layout: Layout) -> None:
        """Take another layout: operator, sensor and memories stay, the linear part begins anew."""
        before, theta = self.layout.parts, self.theta
        self.layout, self.theta = layout, layout.start()
        for name in (*layout.operator.parts, "map", "sensor", "rest", "memory"):
            self.theta[layout.parts[name]] = theta[before[name]]

    def free_of(self, k: int, *, gathered: bool) -> Free:
        """What is free in a record, by blocks or ``gathered`` over stretches.

        The regressors are kept while they stay the same.
        """
        record, slow = self.records[k], self.layout.time_constants
        key = record.tones, tuple(slow)
        if k not in self._regressors or self._regressors[k][0] != key:
            columns = record.regressors(slow, self.layout.settings.creep)
            both = {False: columns, True: record.gathered(columns)}
            self._regressors[k] = key, {way: (one, one.T @ one) for way, one in both.items()}
        return Free(*self._regressors[k][1][gathered], self.variance(record))

    def pieces(self, k: int) -> Iterable[Columns]:
        """∂A/∂(operator) in a record; those of a linear operator are kept.

        They are made anew where what the record remembers has moved by half of what plays resolve.
        """
        operator, record = self.layout.operator, self.records[k]
        theta = self.layout.of_operator(self.theta)
        start, _ = self.layout.start_of(self.theta, record)
        if k in self._columns:
            kept, pieces = self._columns[k]
            if np.abs(start - kept).max() < 0.5 * self.layout.settings.play_step * operator.half:
                return pieces
        made = operator.pieces(theta, record.drive, record.edges, start)
        if not operator.linear:
            return made
        self._columns[k] = start, list(made)
        return self._columns[k][1]


def _same(before: list[object], now: list[object]) -> bool:
    """Whether all are the same objects, and the last equal numbers."""
    pairs = zip(before[:-1], now[:-1], strict=True)
    return len(before) == len(now) and all(a is b for a, b in pairs) and before[-1] == now[-1]


def _finite(values: Array) -> Array:
    if not np.isfinite(values).all():
        raise ScanError("the fit diverged: its operator's response grows without bound")
    return values
