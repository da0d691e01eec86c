"""Proposes an experiment: which drive, of what amplitude and length, tells the hypotheses apart.

The record of hypothesis i is normal about its prediction f_i with the covariance S + C_i: S of
noise and discrepancy, C_i of what its parameters may still change. The Bhattacharyya distance is

    B = d^T (S + C)^-1 d / 8 + ln(|S + C|^2 / (|S + C_i| |S + C_j|)) / 4

with d = f_i - f_j and C = (C_i + C_j) / 2. At least - sum_i p_i log2 sum_j p_j exp(-B_ij) bits are
expected (Kolchinsky and Tracey, Entropy 19, 2017, 361), and for the truth a probability of at least
1 - sum_(i<j) sqrt(p_i p_j) exp(-B_ij), as a harmonic mean is at most the geometric one.

The shortest that is expected to settle the question is proposed, or else the shortest that gives
nearly as much information as any (Lindley, Ann. Math. Stat. 27, 1956, 986). The experiment is
chosen with the amplitudes and lengths of the library, then its own amplitude and length.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations, pairwise, product
from operator import attrgetter

import numpy as np
from attrs import frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.search import OUTSIDE
from afm_scan_ros.core.diagnosis.settings import LIKELIHOOD, SEARCH
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of, predict
from afm_scan_ros.core.types import Array, Trace

SIZES = 1.0, 2.0, 0.5, 4.0, 8.0, 0.25
"""Amplitudes over that of the library."""
LENGTHS = 0.125, 0.25, 0.5, 1.0, 2.0
"""Lengths over that of the library. A drive whose times are the scanner's is never shortened."""


@frozen
class SizedExperiment:
    """An experiment, its ``amplitude`` (V, from the middle of the drive) and ``duration`` (s)."""

    name: str
    amplitude: float
    duration: float

    @classmethod
    def of_library(cls, name: str, model: ScannerModel) -> "SizedExperiment":
        """Return an experiment of the library, for the scanner of a model."""
        listed = EXPERIMENTS[name]
        return cls(name, listed.amplitude_for(model), listed.duration_for(model))

    def plan_for(self, model: ScannerModel) -> Plan:
        """Return the drive for the scanner of a model."""
        return EXPERIMENTS[self.name].plan_for(model, self.amplitude, self.duration)

    def enlarged(self, model: ScannerModel) -> bool:
        """Whether its amplitude exceeds that of the library."""
        return self.amplitude > EXPERIMENTS[self.name].amplitude_for(model)

    def varied(self, model: ScannerModel) -> Iterator["SizedExperiment"]:
        """Yield other amplitudes and lengths within the range of a model, the shortest first."""
        listed = EXPERIMENTS[self.name]
        lengths = [length for length in LENGTHS if length >= 1.0 or not listed.stage]
        for length, size in product(lengths, SIZES if self.amplitude else SIZES[:1]):
            other = SizedExperiment(self.name, size * self.amplitude, length * self.duration)
            if other != self and other.amplitude <= listed.largest_for(model):
                yield other


def distance(products: Array, split: int, variance: Array, known: Array, freedom: Array) -> float:
    """Bhattacharyya distance of two hypotheses.

    ``products`` (cells, m, m) in m² are of their difference, of the first one's deviations, up to
    ``split``, and of the other's; each is one standard deviation. ``variance`` (cells,) in m² is of
    noise and discrepancy, of ``freedom`` (cells,) amplitudes, and ``known`` (cells,) as from so
    many: exp(-B) of what no parameter absorbs is averaged over the true variances, as in Student's
    t distribution.
    """
    scale = np.sqrt([1.0, *[0.5] * (products.shape[1] - 1)])
    products = products * np.outer(scale, scale)
    whole = np.tensordot(freedom / variance, products, 1)
    gram = whole[1:, 1:]
    absorbed = np.linalg.solve(np.eye(len(gram)) + gram, whole[1:, 0])
    left = np.append(1.0, -absorbed)
    power = np.maximum(np.einsum("i,bij,j->b", left, products, left), 0.0)
    apart = 0.5 * known * np.log1p(0.25 * freedom * power / (known * variance))
    alone = (2.0 * whole[part, part] for part in (slice(1, split), slice(split, None)))
    spread = 0.5 * (_log_volume(gram) - 0.5 * sum(map(_log_volume, alone)))
    return float(np.sum(apart)) + float(absorbed @ absorbed) / 8.0 + max(spread, 0.0)


def _log_volume(gram: Array) -> float:
    return float(np.linalg.slogdet(np.eye(len(gram)) + gram)[1])


def information(
    products: Array,
    counts: Sequence[int],
    variances: Array,
    known: Array,
    freedom: Array,
    logs: Sequence[float],
) -> tuple[float, float]:
    """Bits, and the probability of the truth, that are expected at least of n hypotheses.

    ``products`` (cells, m, m) in m² are of their n predictions, then of their deviations, of which
    each has one of ``counts`` (n,). ``variances`` (n, cells) in m² are of noise and discrepancy,
    ``known`` and ``freedom`` (cells,) as in ``distance``, and ``logs`` (n,) the logs of the
    probabilities.
    """
    prior = np.exp(np.asarray(logs) - np.logaddexp.reduce(logs))
    pick, ends = np.eye(products.shape[1]), np.cumsum([len(prior), *counts])
    own = [pick[first:last] for first, last in pairwise(ends)]
    overlap = np.eye(len(prior))
    for i, j in combinations(range(len(prior)), 2):
        rows = np.vstack((pick[i] - pick[j], own[i], own[j]))
        variance = 0.5 * (variances[i] + variances[j])
        apart = distance(rows @ products @ rows.T, 1 + len(own[i]), variance, known, freedom)
        overlap[i, j] = overlap[j, i] = np.exp(-apart)
    wrong = 0.5 * (np.sqrt(prior) @ overlap @ np.sqrt(prior) - 1.0)
    return max(0.0, -float(prior @ np.log2(overlap @ prior))), max(1.0 - float(wrong), 0.0)


NEARLY_ALL = 0.95
"""Share of the largest expected information that is as good as all of it."""
LONGEST = 600.0
"""Length (s) of a proposed experiment, at most."""
SHARE = 0.1
"""Share of a posterior standard deviation by which a prediction is differentiated."""
PREDICTED = 250_000
"""Samples of a prediction, at most; a longer drive is decimated."""


@frozen(eq=False)
class Hypothesis:
    """A chain and its neighbours at a ``SHARE`` of the deviations; the log of its probability."""

    chain: Chain
    log: float
    deviated: tuple[Chain, ...] = ()


@frozen
class Proposal:
    """An experiment for an axis, its predicted ``motion`` (m, amplitude) and what it gives.

    ``bits`` and the ``probability`` of the truth are expected at least. All are NaN where it was
    not assessed.
    """

    axis: str
    experiment: SizedExperiment
    motion: float = np.nan
    bits: float = np.nan
    probability: float = np.nan

    @property
    def settles(self) -> bool:
        """Whether the truth is expected to be as probable as what is named."""
        return self.probability >= SEARCH.certain


def hypotheses(diagnosed: AxisDiagnosis) -> list[Hypothesis]:
    """Best trial of each set in the credible set."""
    posterior, chain = diagnosed.selection.posterior, diagnosed.chain
    found = []
    for names in posterior.credible(SEARCH.certain):
        if best := posterior.best.get(names):
            near = tuple(best.deviated(chain, SHARE))
            found.append(Hypothesis(best.extended(chain), posterior.logs[names], near))
        elif names != OUTSIDE:
            found.append(Hypothesis(chain, posterior.logs[names]))
    return found


def propose(
    axis: str,
    model: ScannerModel,
    credible: Sequence[Hypothesis],
    names: Iterable[str],
    longest: float = LONGEST,
) -> Proposal | None:
    """Propose one of some experiments of at most ``longest`` s; None where none tells anything."""

    def tried(experiments: Iterable[SizedExperiment]) -> list[Proposal]:
        """Assess experiments in turn, up to the first that settles the question."""
        assessed: list[Proposal] = []
        for each in experiments:
            if each.duration <= longest and not any(a.settles for a in assessed):
                assessed += assess(axis, each, model, credible)
        return assessed

    listed = (SizedExperiment.of_library(name, model) for name in names)
    found = tried(sorted(listed, key=lambda e: e.duration))
    if best := _best(found):
        shorter = best.experiment.duration if best.settles else np.inf
        found += tried(e for e in best.experiment.varied(model) if e.duration < shorter)
    return _best(found)


def _best(found: Sequence[Proposal]) -> Proposal | None:
    """Return the shortest of those that settle the question, or that give nearly all bits."""
    most = max((each.bits for each in found), default=0.0)
    settling = [each for each in found if each.settles]
    enough = settling or [each for each in found if each.bits >= NEARLY_ALL * most > 0.0]
    size = attrgetter("experiment.duration", "experiment.amplitude")
    return min(enough, key=size, default=None)


def assess(
    axis: str, experiment: SizedExperiment, model: ScannerModel, credible: Sequence[Hypothesis]
) -> list[Proposal]:
    """Return a proposal with what it is expected to give, in a list.

    The list is empty where the drive, or the motion of an enlarged one, leaves the range that the
    model was identified in. Motion that the model was not tested with makes nothing certain.
    """
    plan = experiment.plan_for(model)
    whole = excitation_block(plan, 0, plan.total_samples)
    step = -(-plan.total_samples // PREDICTED)
    drive = Trace(0, step * plan.sample_period, whole.x[::step], whole.y[::step])
    try:
        moved = predict(model, drive)
        record = Record.of_traces(experiment.name, drive, moved, start="depolarised")
        seen = evidence_of(axis, model, record)
        bits, probability = _expected(seen, chain_of(model.axis(axis)), credible)
    except BeyondRangeError:
        return []
    motion = 0.5 * float(np.ptp(moved.axis(axis)))
    if experiment.enlarged(model) and motion > half_range_of(model.axis(axis)):
        return []
    return [Proposal(axis, experiment, motion, bits, 0.0 if seen.untested else probability)]


def _expected(seen: Evidence, base: Chain, credible: Sequence[Hypothesis]) -> tuple[float, float]:
    """Bits and probability that are expected of a record that hypotheses predict."""
    played, plain = seen.playback.displacement, seen.playback.displacement(base)
    moved = [played(each.chain) - plain for each in credible]
    changed = [
        (played(near) - plain - own) / SHARE
        for own, each in zip(moved, credible, strict=True)
        for near in each.deviated
    ]
    of, formula = seen.variance, LIKELIHOOD.formula_error**2
    all_moved = seen.cells.along(np.array(moved + changed))
    return information(
        seen.cells.products(all_moved, all_moved),
        [len(each.deviated) for each in credible],
        np.array([of.total + formula * seen.cells.power(own) for own in all_moved[: len(moved)]]),
        of.known,
        of.freedom,
        [each.log for each in credible],
    )
