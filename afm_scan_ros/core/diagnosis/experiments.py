"""Proposes an experiment: which drive, of what amplitude and length, tells the hypotheses apart.

The shortest that is expected to settle the question is proposed, or else the shortest that gives
nearly as much information as any (Lindley, Ann. Math. Stat. 27, 1956, 986). The experiment is
chosen with the amplitudes and lengths of the library, then its own amplitude and length.
"""

from collections.abc import Iterable, Sequence
from operator import attrgetter

import numpy as np
from attrs import frozen

from afm_scan_ros.core.bands import coefficients
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN, AxisDiagnosis
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.information import information
from afm_scan_ros.core.diagnosis.likelihood import FORMULA_ERRORS, known_freedom, known_variance
from afm_scan_ros.core.diagnosis.posterior import OUTSIDE
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.effects.scale import half_range_of
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.sized import SizedExperiment
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Trace

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
        return self.probability >= CERTAIN


def hypotheses(diagnosed: AxisDiagnosis) -> list[Hypothesis]:
    """Best trial of each set in the credible set."""
    posterior, chain = diagnosed.selection.posterior, diagnosed.chain
    found = []
    for names in posterior.credible(CERTAIN):
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
        record = Observation(experiment.name, drive, moved, depolarised=True)
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
    played = seen.playback.displacement
    plain, moved = played(base), [played(each.chain) for each in credible]
    changed = [
        (played(near) - own) / SHARE
        for own, each in zip(moved, credible, strict=True)
        for near in each.deviated
    ]
    known, formula = known_variance(seen.limit), max(FORMULA_ERRORS) ** 2
    all_moved = coefficients(np.array(moved + changed))
    return information(
        seen.band_products(all_moved, all_moved),
        [len(each.deviated) for each in credible],
        np.array([known + formula * seen.power(own - plain) for own in moved]),
        known_freedom(seen),
        [each.log for each in credible],
    )
