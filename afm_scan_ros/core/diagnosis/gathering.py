"""A record as evidence on one axis: its view, the memory it began with, and its floor."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.between_levels import error_between_levels
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.floor import Floor, floor_of
from afm_scan_ros.core.diagnosis.memory import DEPOLARISED
from afm_scan_ros.core.diagnosis.observation import Observation, View
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.diagnosis.recollection import recollect
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.known_error import KnownError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array


def gathered(axis: str, model: ScannerModel, observed: Observation, number: int = 0) -> Evidence:
    """Evidence of one axis of a record, from the memory with which it seems to have begun.

    Only a scan tells the level from its rest on: what has no preparation steps at its first move.
    ``number`` is the record's among those that are looked at together.
    Raises InputError where the model states no known error.
    """
    other = _other(axis, model, observed)
    view, known = evolve(_view(observed, axis, other), number=number), _known(axis, model)
    chain = chain_of(model.axis(axis))
    playback = _playback(chain, view, known, observed)
    floor = _floor(playback, chain, known)
    if observed.spec:
        lines = phases(observed.spec).lines
        return Evidence(playback, floor, slice(lines.start, lines.stop), chain.model.vibration)
    duration = len(view.measured) * view.sample_period
    return Evidence(playback, floor.unprepared(duration), stage=chain.model.vibration)


def _other(axis: str, model: ScannerModel, observed: Observation) -> Array:
    """What the other axis does of itself (m), (n,): nothing where the model lacks it."""
    (other,) = (name for name in AXES if name != axis)
    still = np.zeros(fast_length(len(observed.drive.x)))
    if other not in model.axes:
        return still
    alone = evolve(chain_of(model.axis(other)), coupling=())
    played = _playback(alone, _view(observed, other, still), _known(other, model), observed)
    return played.displacement(evolve(alone, output=()))


def _view(observed: Observation, axis: str, other: Array) -> View:
    drive, measured = (
        trace.axis(axis)[: len(other)] for trace in (observed.drive, observed.displacement)
    )
    return View(observed.name, observed.sample_period, drive, measured, other, rates=observed.rates)


def _playback(
    chain: Chain, view: View, known: Sequence[KnownError], observed: Observation
) -> Playback:
    begun = DEPOLARISED if observed.depolarised else recollect(chain, view, known)
    return Playback(view, begun)


def _floor(playback: Playback, chain: Chain, known: Sequence[KnownError]) -> Floor:
    view = playback.view
    floor = floor_of(known, view.measured, view.sample_period)
    between = error_between_levels(playback, chain)
    return floor.at_least(rms_by_band(between, floor.edges, view.sample_period))


def _known(axis: str, model: ScannerModel) -> tuple[KnownError, ...]:
    known = model.axis(axis).known_errors
    if not known:
        raise InputError(
            f"the model of axis {axis} states no known_error, so nothing tells a missing effect"
            " from the model's own error: identify it anew, with its validation record"
        )
    return known
