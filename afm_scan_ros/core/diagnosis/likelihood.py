"""The likelihood of the residuals of one axis: sensor noise and model discrepancy, by band.

In a band of a record the residual has a mean square s2. Noise and discrepancy have the variance v
there. The discrepancy has n independent amplitudes in a band, and v is known as from k of them. So
the residual has Student's t distribution in n dimensions,

    ln p = -n/2 ln v - (n + k)/2 ln(1 + n s2 / (k v)) + constant.

The formula of an effect may be inexact. With probability 1/2 it is exact. Else its displacement, of
mean square e2 in the band, is wrong by a share r of it, which adds r^2 e2 to v.

Of the parameters' deviations d from the model, in standard deviations, the prior is normal:

    s2(d) = s2 - 2 d^T l + d^T G d,    ln p = ln p(s2(d)) - d^T d / 2 - ln det(I + W G) / 2.

l and G are the mean products of the influences with the residual and with each other, and W the
weights of the bands. The last term is the volume of the posterior by Laplace's method. ln p(s2) is
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

from afm_scan_ros.core.bands import coefficients
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import DetectionLimit
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.types import Array

ROUNDS = 50
PRECISION = 1e-6
"""Change, in standard deviations, that ends the search."""
Weights = Callable[[Array], Array]
"""Minus twice the slope (bands,) of the log density over the mean squares (bands,)."""


@frozen(eq=False)
class Profile:
    """Most likely deviations (m,), and the mean squares (bands,) that they leave.

    ``log_base`` is the log of the prior there and of the posterior's volume over the prior's.
    """

    deviations: Array
    power: Array
    log_base: float


@frozen(eq=False)
class LinearResidual:
    """``power`` (bands,) in m², ``slope`` (bands, m) and ``gram`` (bands, m, m): s2, l and G."""

    power: Array
    slope: Array
    gram: Array

    def at(self, deviations: Array) -> Array:
        """Mean squares (bands,) that some deviations (m,) leave."""
        taken = 2.0 * self.slope @ deviations - deviations @ self.gram @ deviations
        return np.asarray(np.maximum(self.power - taken, 0.0))

    def profiled(self, weights: Weights) -> Profile:
        """Most likely deviations."""
        here: Array = np.zeros(self.slope.shape[1])
        for _ in range(ROUNDS):
            weight = weights(self.at(here))
            inner = np.eye(len(here)) + np.tensordot(weight, self.gram, 1)
            there = np.asarray(np.linalg.solve(inner, weight @ self.slope), dtype=np.float64)
            if np.all(np.abs(there - here) <= PRECISION):
                break
            here = there
        volume = -0.5 * float(np.linalg.slogdet(inner)[1])
        return Profile(there, self.at(there), volume - 0.5 * float(there @ there))


FREEDOM, KNOWN_FREEDOM, UNTESTED_FREEDOM = 1.4, 8.0, 2.0
"""Independent amplitudes of the discrepancy in a band, n, and those from which it is known, k.

The last is k where the discrepancy is known from other motion, or from fitted records alone.
"""
TYPICAL_SHARE = 0.3
"""Mean square of the discrepancy over its detection limit, which is an upper bound."""
FORMULA_ERRORS = 0.0, 0.1
"""Relative errors r of an effect's displacement, each as likely."""
REMARKABLE = 0.01
"""Probability of a larger residual in a band, below which effects are searched for."""
SIZES = 64
"""Points of an integral over the size of something that no effect describes."""
FALSE_LACK = 0.01
"""False discovery rate of the lack-of-fit test over the bands."""


def log_density(power: Array, variance: Array, known: Array, freedom: Array | None = None) -> Array:
    """Log likelihood of bands of mean square ``power``, in m² as the ``variance``.

    The variance is ``known`` as from so many amplitudes, k. The power has those of ``freedom``, n,
    or FREEDOM where that is None. Constant terms are left out.
    """
    count = FREEDOM if freedom is None else freedom
    excess = np.log1p(count * power / (known * variance))
    return np.asarray(-0.5 * (count * np.log(variance) + (count + known) * excess))


def weights(power: Array, variance: Array, known: Array) -> Array:
    """Minus twice the slope (bands,) of the log density over ``power``, in 1/m²."""
    return np.asarray(FREEDOM * (FREEDOM + known) / (known * variance + FREEDOM * power))


def known_freedom(evidence: Evidence) -> Array:
    """Amplitudes (bands,) from which the variance is known."""
    known = UNTESTED_FREEDOM if evidence.untested else KNOWN_FREEDOM
    return np.full(len(evidence.limit.rms), known)


def known_variance(limit: DetectionLimit) -> Array:
    """Variance (bands,) in m² of sensor noise and model discrepancy."""
    noise = limit.noise**2
    return np.asarray(noise + TYPICAL_SHARE * np.maximum(limit.rms**2 - noise, 0.0))


@frozen(eq=False)
class BandFit:
    """Residual of a chain in the bands of all records: ``power`` and ``variance`` (bands,), m².

    ``known`` (bands,) are the amplitudes from which the variance is known. ``log_likelihood`` is in
    nats, relative to that of a residual of zero without an effect. ``freedom`` (bands,) are the
    amplitudes of the residual, FREEDOM where None. ``deviations`` (m,) are those of the free base
    parameters, and ``log_base`` is what they cost of it.
    """

    power: Array
    variance: Array
    known: Array
    log_likelihood: float
    freedom: Array | None = None
    deviations: Array = field(factory=lambda: np.empty(0))
    log_base: float = 0.0

    @classmethod
    def of(
        cls, power: Array, added: Array, least: Array, known: Array, freedom: Array | None = None
    ) -> "BandFit":
        """Fit of a residual where effects have ``added`` a displacement, both mean squares in m².

        ``least`` is the variance without that of an effect's inexact formula. No base parameter is
        free.
        """
        variances = [least + share**2 * added for share in FORMULA_ERRORS]
        zero = np.sum(log_density(np.zeros_like(least), least, known, freedom))
        sums = [np.sum(log_density(power, each, known, freedom)) for each in variances]
        logs = np.array(sums) - zero
        mean = float(logsumexp(logs) - np.log(len(logs)))
        return cls(power, variances[int(logs.argmax())], known, mean, freedom)

    @property
    def tail(self) -> Array:
        """Probability (bands,) of a larger residual: that of the F distribution."""
        count = FREEDOM if self.freedom is None else self.freedom
        return np.asarray(scipy.stats.f.sf(self.power / self.variance, count, self.known))

    @property
    def lacking(self) -> NDArray[np.bool_]:
        """Bands (bands,) whose residual is too large, at a false discovery rate of FALSE_LACK.

        By the procedure of Benjamini and Hochberg (J. R. Stat. Soc. B 57, 1995, 289).
        """
        tail = self.tail
        ranked = np.sort(tail)
        below = ranked[ranked <= FALSE_LACK * np.arange(1, len(tail) + 1) / len(tail)]
        return np.asarray(tail <= below[-1]) if len(below) else np.zeros(len(tail), dtype=bool)

    @property
    def unremarkable(self) -> bool:
        """Whether no band alone makes a search for effects necessary."""
        return not np.any(self.tail < REMARKABLE)

    @property
    def adequate(self) -> bool:
        """Whether no band lacks anything."""
        return not self.lacking.any()

    def outside(self, most: Array) -> float:
        """Log evidence (nats) of something that no effect describes, of up to ``most`` (bands,)."""
        return Outside.beyond(self, most).log_evidence(self.power)


@frozen(eq=False)
class Outside:
    """Something in a band that adds to its ``variance`` (bands,), with a probability of its own.

    ``more`` (sizes, bands) are variances with it, each as likely. The probability is uniform.
    """

    variance: Array
    more: Array
    known: Array
    freedom: Array | None = None

    @classmethod
    def beyond(cls, fit: BandFit, most: Array) -> "Outside":
        """Variances beyond those of a fit, uniform in the logarithm up to ``most`` (bands,), m²."""
        ratio = np.maximum(most / fit.variance, math.e)
        more = fit.variance * (1.0 + ratio ** np.linspace(0.0, 1.0, SIZES)[:, np.newaxis])
        return cls(fit.variance, more, fit.known, fit.freedom)

    def log_evidence(self, power: Array) -> float:
        """Log evidence of mean squares (bands,), relative to a residual of zero without it."""
        zero = log_density(np.zeros_like(power), self.variance, self.known, self.freedom).sum()
        return float(logsumexp(self._bands(power)[0].sum(axis=1)) - np.log(SIZES) - zero)

    def weights(self, power: Array) -> Array:
        """Minus twice the slope (bands,) of the log evidence."""
        bands, there = self._bands(power)
        share = softmax(bands.sum(axis=1)) @ np.exp(there - bands)
        sizes = softmax(log_density(power, self.more, self.known), axis=0)
        larger = np.sum(sizes * weights(power, self.more, self.known), axis=0)
        return np.asarray(
            (1.0 - share) * weights(power, self.variance, self.known) + share * larger
        )

    def _bands(self, power: Array) -> tuple[Array, Array]:
        """Log evidence (shares, bands) of each band, and its part with something there."""
        known = log_density(power, self.variance, self.known, self.freedom)
        sizes = log_density(power, self.more, self.known, self.freedom)
        there = logsumexp(sizes, axis=0) - np.log(SIZES)
        shares = (np.arange(SIZES)[:, np.newaxis] + 0.5) / SIZES
        present = np.log(shares) + there
        return np.logaddexp(np.log1p(-shares) + known, present), present


@frozen(eq=False, slots=False)
class Likelihood:
    """Likelihood of chains that have effects beyond a ``base``, over all records of one axis."""

    evidence: tuple[Evidence, ...]
    base: Chain

    def fit(self, chain: Chain) -> BandFit:
        """Fit of a chain to all records."""
        left = [each.residual(chain) for each in self.evidence]
        pairs = list(zip(self.evidence, left, self._without, strict=True))
        power = self._power(left)
        added = np.concatenate([each.power(signal - base) for each, signal, base in pairs])
        least = np.concatenate([known_variance(each.limit) for each in self.evidence])
        known = np.concatenate([known_freedom(each) for each in self.evidence])
        variances = [least + share**2 * added for share in FORMULA_ERRORS]
        residual = self._linear(power, left)
        fits = [residual.profiled(partial(weights, variance=v, known=known)) for v in variances]
        zero = np.sum(log_density(np.zeros_like(least), least, known))
        logs = np.array(
            [
                np.sum(log_density(fit.power, each, known)) - zero + fit.log_base
                for fit, each in zip(fits, variances, strict=True)
            ]
        )
        mean, best = float(logsumexp(logs) - np.log(len(logs))), int(logs.argmax())
        found = fits[best]
        costs = found.deviations, found.log_base
        return BandFit(found.power, variances[best], known, mean, None, *costs)

    def outside(self) -> float:
        """Log evidence (nats) of something that no effect describes, by the residual of the base.

        It may reach the mean square of the motion.
        """
        fit = self.fit(self.base)
        most = [np.full(len(e.limit.rms), np.var(e.playback.view.measured)) for e in self.evidence]
        outside = Outside.beyond(fit, np.concatenate(most))
        found = self._linear(self._power(self._without), self._without).profiled(outside.weights)
        return outside.log_evidence(found.power) + found.log_base

    def reweighted(self, fit: BandFit) -> list[Evidence]:
        """Evidence whose least squares are those of the likelihood about a fit.

        Lange, Little and Taylor (J. Am. Stat. Assoc. 84, 1989, 881).
        """
        scale = (fit.known * fit.variance + FREEDOM * fit.power) / (FREEDOM + fit.known)
        ends = np.cumsum([len(each.limit.rms) for each in self.evidence])[:-1]
        parts = zip(self.evidence, np.split(np.sqrt(scale), ends), strict=True)
        return [evolve(each, limit=evolve(each.limit, rms=rms)) for each, rms in parts]

    def _power(self, left: Sequence[Array]) -> Array:
        pairs = zip(self.evidence, left, strict=True)
        return np.concatenate([each.power(signal) for each, signal in pairs])

    def _linear(self, power: Array, left: Sequence[Array]) -> LinearResidual:
        """Residuals (n,) of mean squares ``power``, linear in the free base parameters."""
        each = zip(self.evidence, self._influences, left, strict=True)
        slope = [
            e.band_products(moved, coefficients(signal[np.newaxis])) for e, moved, signal in each
        ]
        return LinearResidual(power, np.concatenate(slope)[:, :, 0], self._gram)

    @cached_property
    def _influences(self) -> list[Array]:
        """Coefficients (m, n) of the displacement by the free base parameters."""
        return [coefficients(each.base) for each in self.evidence]

    @cached_property
    def _gram(self) -> Array:
        pairs = zip(self.evidence, self._influences, strict=True)
        return np.concatenate([each.band_products(moved, moved) for each, moved in pairs])

    @cached_property
    def _without(self) -> list[Array]:
        return [each.residual(self.base) for each in self.evidence]
