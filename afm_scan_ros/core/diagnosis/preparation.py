"""Prepares a record as evidence on one axis: signals, initial state and detection limit."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.coverage import Motion, untested_motion
from afm_scan_ros.core.diagnosis.discrepancy import (
    DetectionLimit,
    detection_limit,
    error_between_levels,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.initial_state_fit import estimate_initial_state
from afm_scan_ros.core.diagnosis.playback import DEPOLARISED, Playback
from afm_scan_ros.core.diagnosis.records import AxisSignals, Observation
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import AXES, Array

LEAST_MOTION = 100.0
"""Peak-to-peak motion over the sensor's noise, below which a record shows nothing of a model."""


def evidence_of(axis: str, model: ScannerModel, observed: Observation, number: int = 0) -> Evidence:
    """Evidence of one axis of a record, from its estimated initial hysteresis state.

    A record without preparation steps at its first move. ``number`` is the record's place among
    those that are diagnosed together.
    Raises InputError where the model states no model discrepancy.
    """
    other = _other(axis, model, observed)
    view, known = evolve(_axis_signals(observed, axis, other), number=number), _known(axis, model)
    chain = chain_of(model.axis(axis))
    playback = _playback(chain, view, known, observed)
    limit = _detection_limit(playback, chain, known)
    untested = _untested(playback, chain, known, limit)
    if observed.spec:
        return Evidence(playback, limit, untested)
    duration = len(view.measured) * view.sample_period
    return Evidence(playback, limit.unprepared(duration), untested)


def _other(axis: str, model: ScannerModel, observed: Observation) -> Array:
    """Displacement (n,) in m of the other axis without coupling; zero where the model lacks it."""
    (other,) = (name for name in AXES if name != axis)
    still = np.zeros(fast_length(len(observed.drive.x)))
    if other not in model.axes:
        return still
    alone = evolve(chain_of(model.axis(other)), coupling=())
    played = _playback(alone, _axis_signals(observed, other, still), _known(other, model), observed)
    return played.displacement(evolve(alone, output=()))


def _axis_signals(observed: Observation, axis: str, other: Array) -> AxisSignals:
    drive, measured = (
        trace.axis(axis)[: len(other)] for trace in (observed.drive, observed.displacement)
    )
    return AxisSignals(
        observed.name, observed.sample_period, drive, measured, other, rates=observed.rates
    )


def _playback(
    chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy], observed: Observation
) -> Playback:
    begun = DEPOLARISED if observed.depolarised else estimate_initial_state(chain, view, known)
    return Playback(view, begun)


def _detection_limit(
    playback: Playback, chain: Chain, known: Sequence[ModelDiscrepancy]
) -> DetectionLimit:
    view = playback.view
    resonance = resonance_of(chain.model.vibration, view.sample_period)
    limit = detection_limit(known, view.measured, view.sample_period, resonance)
    between = error_between_levels(playback, chain)
    return limit.at_least(rms_by_band(between, limit.edges, view.sample_period))


def _untested(
    playback: Playback, chain: Chain, known: Sequence[ModelDiscrepancy], limit: DetectionLimit
) -> Motion | None:
    """Motion at which the error is not known; none of a record that hardly moves."""
    moved = playback.displacement(chain)
    if np.ptp(moved) <= LEAST_MOTION * np.linalg.norm(limit.noise):
        return None
    return untested_motion(known, moved, playback.view.sample_period, limit.resonance)


def _known(axis: str, model: ScannerModel) -> tuple[ModelDiscrepancy, ...]:
    known = model.axis(axis).model_discrepancies
    if not known:
        raise InputError(
            f"the model of axis {axis} states no model_discrepancy, so a missing effect cannot be"
            " distinguished from the model's own error: give records of the healthy scanner, or"
            " identify it anew, with a further record of the kind validation, that fits nothing"
        )
    return known
