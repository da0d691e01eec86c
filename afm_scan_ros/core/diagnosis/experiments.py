"""Ranks experiments by the information that they are expected to give on the credible set.

The expected information is that of the posterior's change (Lindley, Ann. Math. Stat. 27, 1956,
986). Each model of the credible set in turn is taken as true, and the record that it predicts is
given to the others.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from scipy.special import logsumexp

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN, AxisDiagnosis
from afm_scan_ros.core.diagnosis.likelihood import known_variance, log_density
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict


@frozen(eq=False)
class WeightedChain:
    """A chain of the credible set, and the log of its probability."""

    chain: Chain
    log: float


def credible_chains(diagnosed: AxisDiagnosis) -> list[WeightedChain]:
    """Best chain of each set in the credible set."""
    posterior = diagnosed.selection.posterior
    found = []
    for names in posterior.credible(CERTAIN):
        best = posterior.best.get(names)
        chain = best.extended(diagnosed.chain) if best else diagnosed.chain
        found.append(WeightedChain(chain, posterior.logs[names]))
    return found


def rank_experiments(
    axis: str, model: ScannerModel, credible: Sequence[WeightedChain]
) -> list[str]:
    """Names of the experiments that give information, the most of it first."""
    bits = {name: expected_bits(name, axis, model, credible) for name in EXPERIMENTS}
    return sorted((name for name in bits if bits[name] > 0.0), key=lambda name: -bits[name])


def expected_bits(
    name: str, axis: str, model: ScannerModel, credible: Sequence[WeightedChain]
) -> float:
    """Information (bits) that an experiment is expected to give on which chain is true.

    Zero where the drive leaves the range that the model was identified in.
    """
    plan = EXPERIMENTS[name].plan()
    drive = excitation_block(plan, 0, plan.total_samples)
    try:
        record = Observation(name, drive, predict(model, drive))
        seen = evidence_of(axis, model, record)
        moved = [seen.playback.displacement(each.chain) for each in credible]
    except BeyondRangeError:
        return 0.0
    known = known_variance(seen.limit)
    prior = np.array([each.log for each in credible])
    prior -= logsumexp(prior)
    nats = 0.0
    for true, log in zip(moved, prior, strict=True):
        likelihoods = [
            float(np.sum(log_density(seen.power(true - other) + known, known))) for other in moved
        ]
        own = float(np.sum(log_density(known, known)))
        nats -= np.exp(log) * (float(logsumexp(prior + np.array(likelihoods))) - own)
    return float(nats / np.log(2.0))
