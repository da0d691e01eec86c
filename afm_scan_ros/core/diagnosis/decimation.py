"""Decimation of long records, for the search of starting values.

This search takes hundreds of predictions; fits and scores use the full record. Decimation keeps
the whole duration, and with it drift and the motion of the other axis, which an excerpt would not.
The rate is halved while two conditions hold. The model predicts the same displacement at the
remaining samples, and the residual at the removed frequencies is at its detection limit.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.playback import Playback

LONG_RECORD = 8_000
"""Samples up to which a record is not decimated, because its predictions take little time."""
EQUAL_WITHIN = 0.3
"""Share of the detection limit by which a prediction may differ in any band, a tenth in power."""


def decimated(evidence: Evidence, chain: Chain) -> Evidence:
    """Evidence at the lowest rate that determines a chain as well; short records unchanged."""
    if len(evidence.playback.view.drive) <= LONG_RECORD:
        return evidence
    fewer = _every_other(evidence)
    return decimated(fewer, chain) if _same(evidence, fewer, chain) else evidence


def _every_other(evidence: Evidence) -> Evidence:
    """Evidence of every other sample, with the drive averaged over pairs of samples."""
    view = evidence.playback.view
    count = fast_length(len(view.drive) // 2)
    drive = view.drive[: 2 * count].reshape(count, 2).mean(axis=1)
    measured, other = (each[: 2 * count : 2].copy() for each in (view.measured, view.other))
    period = 2.0 * view.sample_period
    fewer = evolve(view, sample_period=period, drive=drive, measured=measured, other=other)
    playback = Playback(fewer, evidence.playback.initial_state)
    base = evidence.base[:, : 2 * count : 2]
    return Evidence(playback, evidence.limit.sampled(period), base=base)


def _same(evidence: Evidence, fewer: Evidence, chain: Chain) -> bool:
    """Whether the samples left out hold no more information on a chain."""
    predicted, sampled = (e.playback.displacement(chain) for e in (fewer, evidence))
    moved = predicted - sampled[: 2 * len(predicted) : 2]
    limit = fewer.limit
    differs = rms_by_band(moved, limit.edges, fewer.playback.view.sample_period) / limit.rms
    unseen = np.array(evidence.limit.edges[1:]) > limit.edges[-1]
    return bool(differs.max() < EQUAL_WITHIN and evidence.ratio(chain)[unseen].max() < AT_LIMIT)
