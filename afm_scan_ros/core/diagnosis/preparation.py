"""A record as evidence on one axis: its view, the memory it began with, and its floor."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import (
    DetectionLimit,
    detection_limit,
    error_between_levels,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.initial_state_fit import estimate_initial_state
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.diagnosis.records import AxisSignals, Observation
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array


def evidence_of(axis: str, model: ScannerModel, observed: Observation, number: int = 0) -> Evidence:
    """Evidence of one axis of a record, from the memory with which it seems to have begun.

    Only a scan tells the level from its rest on: what has no preparation steps at its first move.
    ``number`` is the record's among those that are looked at together.
    Raises InputError where the model states no model discrepancy.
    """
    (other,) = (name for name in AXES if name != axis)
    count = fast_length(len(observed.drive.x))
    alone = evolve(chain_of(model.axis(other)), coupling=())
    unmoved = _axis_signals(observed, other, np.zeros(count))
    played = _playback(alone, unmoved, _known(other, model))
    own = played.displacement(evolve(alone, output=()))
    view, known = evolve(_axis_signals(observed, axis, own), number=number), _known(axis, model)
    chain = chain_of(model.axis(axis))
    playback = _playback(chain, view, known)
    floor = _detection_limit(playback, chain, known)
    if observed.spec:
        lines = phases(observed.spec).lines
        return Evidence(playback, floor, slice(lines.start, lines.stop), chain.model.vibration)
    duration = len(view.measured) * view.sample_period
    return Evidence(playback, floor.unprepared(duration), stage=chain.model.vibration)


def _axis_signals(observed: Observation, axis: str, other: Array) -> AxisSignals:
    drive, measured = (
        trace.axis(axis)[: len(other)] for trace in (observed.drive, observed.displacement)
    )
    return AxisSignals(
        observed.name, observed.sample_period, drive, measured, other, rates=observed.rates
    )


def _playback(chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy]) -> Playback:
    return Playback(view, estimate_initial_state(chain, view, known))


def _detection_limit(
    playback: Playback, chain: Chain, known: Sequence[ModelDiscrepancy]
) -> DetectionLimit:
    view = playback.view
    floor = detection_limit(known, view.measured, view.sample_period)
    between = error_between_levels(playback, chain)
    return floor.at_least(rms_by_band(between, floor.edges, view.sample_period))


def _known(axis: str, model: ScannerModel) -> tuple[ModelDiscrepancy, ...]:
    known = model.axis(axis).model_discrepancies
    if not known:
        raise InputError(
            f"the model of axis {axis} states no model_discrepancy, so nothing tells a missing"
            f" effect"
            " from the model's own error: identify it anew, with its validation record"
        )
    return known
