"""A glance at a long record: at a lower rate, from its first sample to its last.

Where fits begin takes hundreds of predictions, and none of them is the answer: the candidates that
promise most are fitted to the record itself, and judged by it. A scan of minutes is sampled far
more often than it moves, so a glance sees all of it, drift and the other axis' way too, which no
excerpt would show. Every other sample is left out as long as nothing is lost by that: the model
predicts the same of the rest, and what moves faster than they tell is at its floor.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.playback import Playback

LONG_RECORD = 250_000
"""Samples up to which a record is looked at as it is: forty lines at 5 Hz are 194,000, the longest
experiment 243,000."""
EQUAL_WITHIN = 0.3
"""Of the floor, by which a prediction may differ in any band: a tenth of the floor's power."""


def decimated(evidence: Evidence, chain: Chain) -> Evidence:
    """Evidence at the lowest rate that tells the same of a chain; a short record's is its own."""
    if len(evidence.playback.view.drive) <= LONG_RECORD:
        return evidence
    fewer = _every_other(evidence)
    return decimated(fewer, chain) if _same(evidence, fewer, chain) else evidence


def _every_other(evidence: Evidence) -> Evidence:
    """Evidence of every other sample, under the mean of what was held from one to the next."""
    view = evidence.playback.view
    count = fast_length(len(view.drive) // 2)
    drive = view.drive[: 2 * count].reshape(count, 2).mean(axis=1)
    measured, other = (each[: 2 * count : 2].copy() for each in (view.measured, view.other))
    period = 2.0 * view.sample_period
    fewer = evolve(view, sample_period=period, drive=drive, measured=measured, other=other)
    playback = Playback(fewer, evidence.playback.initial_state)
    return Evidence(playback, evidence.floor.sampled(period), stage=evidence.stage)


def _same(evidence: Evidence, fewer: Evidence, chain: Chain) -> bool:
    """Whether what is left out of the evidence would have told nothing more of a chain."""
    predicted, sampled = (e.playback.displacement(chain) for e in (fewer, evidence))
    moved = predicted - sampled[: 2 * len(predicted) : 2]
    floor = fewer.floor
    differs = rms_by_band(moved, floor.edges, fewer.playback.view.sample_period) / floor.rms
    unseen = np.array(evidence.floor.edges[1:]) > floor.edges[-1]
    return bool(differs.max() < EQUAL_WITHIN and evidence.ratio(chain)[unseen].max() < AT_LIMIT)
