"""The likelihood of the residuals of one axis: sensor noise and model discrepancy, by cell.

In a cell of a record the residual has a mean square s2. Noise and discrepancy have the variance v
there, of n independent amplitudes, and v is known as from k of them. So the residual has Student's
t distribution in n dimensions,

    ln p = -n/2 ln v - (n + k)/2 ln(1 + n s2 / (k v)) + constant.

The formula of an effect may be inexact. With probability 1/2 it is exact. Else its displacement, of
mean square e2 in the cell, is wrong by a share r of it, which adds r^2 e2 to v.

Of the parameters' deviations d from the model, in standard deviations, the prior is normal:

    s2(d) = s2 - 2 d^T l + d^T G d,    ln p = ln p(s2(d)) - d^T d / 2 - ln det(I + W G) / 2.

l and G are the mean products of the influences with the residual and with each other, and W the
weights of the cells. The last term is the volume of the posterior by Laplace's method. ln p(s2) is
convex, so that each step of the weighted least squares is to a more likely d.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np
import scipy
from attrs import evolve, field, frozen
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.settings import LIKELIHOOD, POSTERIOR
from afm_scan_ros.core.diagnosis.variance import log_density, weights
from afm_scan_ros.core.types import Array

Weights = Callable[[Array], Array]
"""Minus twice the slope (cells,) of the log density over the mean squares (cells,)."""


@frozen(eq=False)
class Profile:
    """Most likely deviations (m,), and the mean squares (cells,) that they leave.

    ``log_base`` is the log of the prior there and of the posterior's volume over the prior's.
    """

    deviations: Array
    power: Array
    log_base: float


@frozen(eq=False)
class LinearResidual:
    """``power`` (cells,) in m², ``slope`` (cells, m) and ``gram`` (cells, m, m): s2, l and G."""

    power: Array
    slope: Array
    gram: Array

    def at(self, deviations: Array) -> Array:
        """Mean squares (cells,) that some deviations (m,) leave."""
        taken = 2.0 * self.slope @ deviations - deviations @ self.gram @ deviations
        return np.asarray(np.maximum(self.power - taken, 0.0))

    def profiled(self, weights: Weights) -> Profile:
        """Most likely deviations."""
        here: Array = np.zeros(self.slope.shape[1])
        for _ in range(LIKELIHOOD.rounds):
            weight = weights(self.at(here))
            inner = np.eye(len(here)) + np.tensordot(weight, self.gram, 1)
            there = np.asarray(np.linalg.solve(inner, weight @ self.slope), dtype=np.float64)
            if np.all(np.abs(there - here) <= LIKELIHOOD.precision):
                break
            here = there
        volume = -0.5 * float(np.linalg.slogdet(inner)[1])
        return Profile(there, self.at(there), volume - 0.5 * float(there @ there))


@frozen(eq=False)
class CellFit:
    """Residual of a chain in the cells of all records: ``power`` and ``variance`` (cells,), m².

    ``freedom`` (cells,) are the amplitudes of the residual, ``known`` (cells,) those from which the
    variance is known. ``log_likelihood`` is in nats, relative to that of a residual of zero without
    an effect. ``deviations`` (m,) are those of the free directions, and ``log_base`` is what
    they cost of it.
    """

    power: Array
    variance: Array
    known: Array
    freedom: Array
    log_likelihood: float
    deviations: Array = field(factory=lambda: np.empty(0))
    log_base: float = 0.0

    @classmethod
    def of(
        cls, power: Array, added: Array, least: Array, known: Array, freedom: Array
    ) -> "CellFit":
        """Fit of a residual where effects have ``added`` a displacement, both mean squares in m².

        ``least`` is the variance without that of an effect's inexact formula. No direction is
        free.
        """
        variances = [least + share**2 * added for share in (0.0, LIKELIHOOD.formula_error)]
        zero = np.sum(log_density(np.zeros_like(least), least, known, freedom))
        sums = [np.sum(log_density(power, each, known, freedom)) for each in variances]
        logs = np.array(sums) - zero
        mean = float(logsumexp(logs) - np.log(len(logs)))
        return cls(power, variances[int(logs.argmax())], known, freedom, mean)

    @property
    def tail(self) -> Array:
        """Probability (cells,) of a larger residual: that of the F distribution."""
        ratio = self.power / self.variance
        return np.asarray(scipy.stats.f.sf(ratio, self.freedom, self.known))

    @property
    def lacking(self) -> NDArray[np.bool_]:
        """Cells (cells,) whose residual is too large, at a false discovery rate of ``false_lack``.

        By the procedure of Benjamini and Hochberg (J. R. Stat. Soc. B 57, 1995, 289).
        """
        tail = self.tail
        ranked = np.sort(tail)
        below = ranked[ranked <= LIKELIHOOD.false_lack * np.arange(1, len(tail) + 1) / len(tail)]
        return np.asarray(tail <= below[-1]) if len(below) else np.zeros(len(tail), dtype=bool)

    @property
    def unremarkable(self) -> bool:
        """Whether no cell alone makes a search for effects necessary."""
        return not np.any(self.tail < LIKELIHOOD.remarkable)

    @property
    def adequate(self) -> bool:
        """Whether no cell lacks anything."""
        return not self.lacking.any()

    def shape_told(self, power: Array, counts: Array | float) -> float:
        """Log evidence (nats) for this fit's effects over something of any shape, beyond its size.

        Whatever leaves a mean ``power`` (cells,) has, where this fit leaves less, so many
        coefficients alike that an unknown shape would have by chance alone. Of their ``counts``
        (cells,) at most ``POSTERIOR.shape`` are independent.
        """
        more = np.maximum(np.minimum(counts, POSTERIOR.shape) - self.freedom, 0.0)
        fell = np.log1p(power / self.variance) - np.log1p(self.power / self.variance)
        return max(0.5 * float(np.sum(more * fell)), 0.0)

    def outside(self, most: Array) -> float:
        """Log evidence (nats) of something that no effect describes, of up to ``most`` (cells,)."""
        return Outside.beyond(self, most).log_evidence(self.power)


@frozen(eq=False)
class Outside:
    """Something in a cell that adds to its ``variance`` (cells,), with a probability of its own.

    ``more`` (sizes, cells) are variances with it, each as likely. The probability is uniform.
    """

    variance: Array
    more: Array
    known: Array
    freedom: Array

    @classmethod
    def beyond(cls, fit: CellFit, most: Array) -> "Outside":
        """Variances beyond those of a fit, uniform in the logarithm up to ``most`` (cells,), m²."""
        ratio = np.maximum(most / fit.variance, math.e)
        more = fit.variance * (
            1.0 + ratio ** np.linspace(0.0, 1.0, LIKELIHOOD.sizes)[:, np.newaxis]
        )
        return cls(fit.variance, more, fit.known, fit.freedom)

    def log_evidence(self, power: Array) -> float:
        """Log evidence of mean squares (cells,), relative to a residual of zero without it."""
        zero = log_density(np.zeros_like(power), self.variance, self.known, self.freedom).sum()
        return float(logsumexp(self._cells(power)[0].sum(axis=1)) - np.log(LIKELIHOOD.sizes) - zero)

    def weights(self, power: Array) -> Array:
        """Minus twice the slope (cells,) of the log evidence."""
        cells, there = self._cells(power)
        share = softmax(cells.sum(axis=1)) @ np.exp(there - cells)
        of_cells = self.known, self.freedom
        sizes = softmax(log_density(power, self.more, *of_cells), axis=0)
        larger = np.sum(sizes * weights(power, self.more, *of_cells), axis=0)
        return np.asarray((1.0 - share) * weights(power, self.variance, *of_cells) + share * larger)

    def _cells(self, power: Array) -> tuple[Array, Array]:
        """Log evidence (shares, cells) of each cell, and its part with something there."""
        known = log_density(power, self.variance, self.known, self.freedom)
        sizes = log_density(power, self.more, self.known, self.freedom)
        there = logsumexp(sizes, axis=0) - np.log(LIKELIHOOD.sizes)
        shares = (np.arange(LIKELIHOOD.sizes)[:, np.newaxis] + 0.5) / LIKELIHOOD.sizes
        present = np.log(shares) + there
        return np.logaddexp(np.log1p(-shares) + known, present), present


@frozen(eq=False, slots=False)
class Likelihood:
    """Likelihood of chains that have effects beyond a ``base``, over all records of one axis."""

    evidence: tuple[Evidence, ...]
    base: Chain

    def fit(self, chain: Chain) -> CellFit:
        """Fit of a chain to all records."""
        left = [each.coefficients(chain) for each in self.evidence]
        power = self._power(left)
        added = self._power([one - other for one, other in zip(left, self._without, strict=True)])
        least, known, freedom = self._of_cells
        variances = [least + share**2 * added for share in (0.0, LIKELIHOOD.formula_error)]
        residual = self._linear(power, left)
        fits = [
            residual.profiled(partial(weights, variance=v, known=known, freedom=freedom))
            for v in variances
        ]
        zero = np.sum(log_density(np.zeros_like(least), least, known, freedom))
        logs = np.array(
            [
                np.sum(log_density(fit.power, each, known, freedom)) - zero + fit.log_base
                for fit, each in zip(fits, variances, strict=True)
            ]
        )
        mean, best = float(logsumexp(logs) - np.log(len(logs))), int(logs.argmax())
        found = fits[best]
        costs = found.deviations, found.log_base
        return CellFit(found.power, variances[best], known, freedom, mean, *costs)

    @property
    def counts(self) -> Array:
        """Number of coefficients (cells,) of each cell."""
        return np.concatenate([each.cells.counts for each in self.evidence])

    def outside(self) -> float:
        """Log evidence (nats) of something that no effect describes, by the residual of the base.

        It may reach the mean square of the motion.
        """
        fit = self.fit(self.base)
        counts = (len(each.variance.total) for each in self.evidence)
        moved = [np.var(each.playback.view.measured) for each in self.evidence]
        most = [np.full(count, power) for count, power in zip(counts, moved, strict=True)]
        outside = Outside.beyond(fit, np.concatenate(most))
        found = self._linear(self._power(self._without), self._without).profiled(outside.weights)
        return outside.log_evidence(found.power) + found.log_base

    def reweighted(self, fit: CellFit) -> list[Evidence]:
        """Evidence whose least squares are those of the likelihood about a fit.

        Lange, Little and Taylor (J. Am. Stat. Assoc. 84, 1989, 881).
        """
        found = weights(fit.power, fit.variance, fit.known, fit.freedom)
        ends = np.cumsum([len(each.weights) for each in self.evidence])[:-1]
        parts = zip(self.evidence, np.split(found, ends), strict=True)
        return [evolve(each, weights=part) for each, part in parts]

    @cached_property
    def _of_cells(self) -> tuple[Array, Array, Array]:
        """Variance, and amplitudes from which it is known and of it, of all cells (cells,)."""
        every = [each.variance for each in self.evidence]
        total, known, freedom = (
            np.concatenate([getattr(each, name) for each in every])
            for name in ("total", "known", "freedom")
        )
        return total, known, freedom

    def _power(self, left: Sequence[Array]) -> Array:
        pairs = zip(self.evidence, left, strict=True)
        return np.concatenate([each.cells.power(coefficients) for each, coefficients in pairs])

    def _linear(self, power: Array, left: Sequence[Array]) -> LinearResidual:
        """Residuals of coefficients (k,), mean squares ``power``, linear in the deviations."""
        slope = [
            e.cells.products(moved, coefficients[np.newaxis])
            for e, moved, coefficients in zip(self.evidence, self._influences, left, strict=True)
        ]
        return LinearResidual(power, np.concatenate(slope)[:, :, 0], self._gram)

    @cached_property
    def _influences(self) -> list[Array]:
        """Coefficients of the displacement by the free directions, of each record."""
        return [each.cells.along(each.base) for each in self.evidence]

    @cached_property
    def _gram(self) -> Array:
        pairs = zip(self.evidence, self._influences, strict=True)
        return np.concatenate([each.cells.products(moved, moved) for each, moved in pairs])

    @cached_property
    def _without(self) -> list[Array]:
        return [each.coefficients(self.base) for each in self.evidence]
