"""Information that a record is expected to give on which hypothesis is true.

The record of hypothesis i is normal about its prediction f_i with the covariance S + C_i: S of
noise and discrepancy, C_i of what its parameters may still change. The Bhattacharyya distance is

    B = d^T (S + C)^-1 d / 8 + ln(|S + C|^2 / (|S + C_i| |S + C_j|)) / 4

with d = f_i - f_j and C = (C_i + C_j) / 2. At least - sum_i p_i log2 sum_j p_j exp(-B_ij) bits are
expected (Kolchinsky and Tracey, Entropy 19, 2017, 361), and for the truth a probability of at least
1 - sum_(i<j) sqrt(p_i p_j) exp(-B_ij), as a harmonic mean is at most the geometric one.
"""

from collections.abc import Sequence
from itertools import combinations, pairwise

import numpy as np

from afm_scan_ros.core.diagnosis.likelihood import FREEDOM
from afm_scan_ros.core.types import Array


def distance(products: Array, split: int, variance: Array, known: Array) -> float:
    """Bhattacharyya distance of two hypotheses.

    ``products`` (bands, m, m) in m² are of their difference, of the first one's deviations, up to
    ``split``, and of the other's; each is one standard deviation. ``variance`` (bands,) in m² is of
    noise and discrepancy, ``known`` (bands,) its degrees of freedom: exp(-B) of what no parameter
    absorbs is averaged over the true variances, as in Student's t distribution.
    """
    scale = np.sqrt([1.0, *[0.5] * (products.shape[1] - 1)])
    products = products * np.outer(scale, scale)
    whole = FREEDOM * np.tensordot(1.0 / variance, products, 1)
    gram = whole[1:, 1:]
    absorbed = np.linalg.solve(np.eye(len(gram)) + gram, whole[1:, 0])
    left = np.append(1.0, -absorbed)
    power = np.maximum(np.einsum("i,bij,j->b", left, products, left), 0.0)
    apart = 0.5 * known * np.log1p(0.25 * FREEDOM * power / (known * variance))
    alone = (2.0 * whole[part, part] for part in (slice(1, split), slice(split, None)))
    spread = 0.5 * (_log_volume(gram) - 0.5 * sum(map(_log_volume, alone)))
    return float(np.sum(apart)) + float(absorbed @ absorbed) / 8.0 + max(spread, 0.0)


def _log_volume(gram: Array) -> float:
    return float(np.linalg.slogdet(np.eye(len(gram)) + gram)[1])


def information(
    products: Array, counts: Sequence[int], variances: Array, known: Array, logs: Sequence[float]
) -> tuple[float, float]:
    """Bits, and the probability of the truth, that are expected at least of n hypotheses.

    ``products`` (bands, m, m) in m² are of their n predictions, then of their deviations, of which
    each has one of ``counts`` (n,). ``variances`` (n, bands) in m² are of noise and discrepancy,
    ``known`` (bands,) their degrees of freedom, and ``logs`` (n,) the logs of the probabilities.
    """
    prior = np.exp(np.asarray(logs) - np.logaddexp.reduce(logs))
    pick, ends = np.eye(products.shape[1]), np.cumsum([len(prior), *counts])
    own = [pick[first:last] for first, last in pairwise(ends)]
    overlap = np.eye(len(prior))
    for i, j in combinations(range(len(prior)), 2):
        rows = np.vstack((pick[i] - pick[j], own[i], own[j]))
        variance = 0.5 * (variances[i] + variances[j])
        apart = distance(rows @ products @ rows.T, 1 + len(own[i]), variance, known)
        overlap[i, j] = overlap[j, i] = np.exp(-apart)
    wrong = 0.5 * (np.sqrt(prior) @ overlap @ np.sqrt(prior) - 1.0)
    return max(0.0, -float(prior @ np.log2(overlap @ prior))), max(1.0 - float(wrong), 0.0)
