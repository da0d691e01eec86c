"""Ranks experiments by the information that they are expected to give on the credible set.

The expected information is that of the posterior's change (Lindley, Ann. Math. Stat. 27, 1956,
986). Each model of the credible set in turn is taken as true, and the record that it predicts is
given to the others. The formula of an effect is taken as inexact, so small differences of large
effects are no information. Of experiments that give nearly as much, the shortest comes first.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from scipy.special import logsumexp

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN, AxisDiagnosis
from afm_scan_ros.core.diagnosis.likelihood import (
    FORMULA_ERRORS,
    known_freedom,
    known_variance,
    log_density,
)
from afm_scan_ros.core.diagnosis.posterior import OUTSIDE
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array

NEARLY_ALL = 0.95
"""Share of the largest expected information that is as good as all of it."""


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
        if names == OUTSIDE:
            continue
        best = posterior.best.get(names)
        chain = best.extended(diagnosed.chain) if best else diagnosed.chain
        found.append(WeightedChain(chain, posterior.logs[names]))
    return found


def rank_experiments(
    axis: str, model: ScannerModel, credible: Sequence[WeightedChain]
) -> list[str]:
    """Names of the experiments that give information: the shortest of the best, then by bits."""
    bits = {name: expected_bits(name, axis, model, credible) for name in EXPERIMENTS}
    enough = NEARLY_ALL * max(bits.values())
    ranked = sorted(
        bits,
        key=lambda n: (bits[n] < enough, _seconds(n, model) if bits[n] >= enough else -bits[n]),
    )
    return [name for name in ranked if bits[name] > 0.0]


def _seconds(name: str, model: ScannerModel) -> float:
    plan = EXPERIMENTS[name].plan_for(model)
    return plan.total_samples * plan.sample_period


def expected_bits(
    name: str, axis: str, model: ScannerModel, credible: Sequence[WeightedChain]
) -> float:
    """Information (bits) that an experiment is expected to give on which chain is true.

    Zero where the drive leaves the range that the model was identified in.
    """
    plan = EXPERIMENTS[name].plan_for(model)
    drive = excitation_block(plan, 0, plan.total_samples)
    try:
        record = Observation(name, drive, predict(model, drive))
        seen = evidence_of(axis, model, record)
        moved = [seen.playback.displacement(each.chain) for each in credible]
        plain = seen.playback.displacement(chain_of(model.axis(axis)))
    except BeyondRangeError:
        return 0.0
    known, formula = known_variance(seen.limit), max(FORMULA_ERRORS) ** 2
    freedom = known_freedom(seen)
    variances = [known + formula * seen.power(each - plain) for each in moved]
    logs = [
        [
            float(np.sum(log_density(known + seen.power(true - each), variance, freedom)))
            for each, variance in zip(moved, variances, strict=True)
        ]
        for true in moved
    ]
    return _information(np.array([each.log for each in credible]), np.array(logs))


def _information(prior: Array, logs: Array) -> float:
    """Bits of the posterior over the ``prior`` (n,), with log likelihoods (true, taken) in nats."""
    prior = prior - logsumexp(prior)
    evidence = logsumexp(prior + logs, axis=1)
    return float(np.sum(np.exp(prior) * (np.diag(logs) - evidence)) / np.log(2.0))
