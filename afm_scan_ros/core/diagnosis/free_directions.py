"""What of the base model is free in every hypothesis: the directions of its ``Spread``.

A calibration does not know the parameters of its model exactly, and what it does not know is no
effect. The model keeps the posterior of all its parameters by the few directions in which
predictions of them vary most. How far the scanner lies along each, in standard deviations, has a
normal prior. A displacement is taken as linear in it.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.settings import POSTERIOR
from afm_scan_ros.core.prediction import varied
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import Array


def with_free_directions(evidence: Sequence[Evidence], chain: Chain) -> tuple[Evidence, ...]:
    """Return the evidence with the directions of a chain's model of which the records tell.

    A model that states no ``Spread`` is held.
    """
    if (spread := chain.model.spread) is None or not spread.directions:
        return tuple(evidence)
    found = [_influence(each, chain, spread) for each in evidence]
    told = np.sum([_information(e, rows) for e, rows in zip(evidence, found, strict=True)], axis=0)
    kept = told > POSTERIOR.negligible
    return tuple(evolve(e, base=rows[kept]) for e, rows in zip(evidence, found, strict=True))


def _influence(evidence: Evidence, chain: Chain, spread: Spread) -> Array:
    """Displacement (directions, n) in m that one standard deviation adds in a record."""
    middle, *ends = (
        evidence.playback.displacement(chain_of(varied(chain.model, each)))
        for each in (spread.centre, *spread.directions)
    )
    deviations = [each.deviations for each in spread.directions]
    return np.array([(end - middle) / d for end, d in zip(ends, deviations, strict=True)])


def _information(evidence: Evidence, influence: Array) -> Array:
    """Information (m,) of a record on each direction over its prior's."""
    moved = evidence.cells.along(influence)
    power = np.diagonal(evidence.cells.products(moved, moved), axis1=1, axis2=2)
    return np.asarray(evidence.variance.weights(np.zeros(len(power))) @ power)
