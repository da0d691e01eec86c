"""Prepares a record as evidence on one axis: signals, initial state and detection limit.

A wrong initial state causes errors up to a micrometre until the drive exceeds the past extremes.
The part of the record up to both of its drive extremes is predicted from many initial states. The
depolarised state is kept unless another one leaves a much smaller residual.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from attrs import evolve
from scipy.optimize import minimize

from afm_scan_ros.core.bands import fast_length, rms_by_band
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.cells import RecordCells
from afm_scan_ros.core.diagnosis.discrepancy import (
    DetectionLimit,
    MotionByBand,
    detection_limit,
    error_between_levels,
    untested_motion,
)
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.records import (
    DEPOLARISED,
    AxisSignals,
    InitialState,
    Playback,
    repetition_rates,
)
from afm_scan_ros.core.diagnosis.settings import EVIDENCE, INITIAL_STATE
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.records.periods import repeated_part
from afm_scan_ros.core.model import ModelDiscrepancy, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array

INNER = (0.0, 0.4, 0.7, 1.0)
"""Shares of the first extreme that are tried as the second."""


def estimate_initial_state(
    chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy]
) -> InitialState:
    """Estimate the initial hysteresis state of one axis of a record."""
    surface = chain.model.hysteresis.forward
    opening = _opening(view)
    limit = _limit_of(chain, opening, known)

    def misfit(initial_state: InitialState) -> float:
        normalised_residual = Evidence(Playback(opening, initial_state), limit).normalised_residual(
            chain
        )
        return float(np.mean(normalised_residual**2))

    limits = surface.drive_range
    before = misfit(DEPOLARISED)
    if before > INITIAL_STATE.within_noise * len(limit.rms):
        start = min(_candidate_states(limits, float(view.drive[0])), key=misfit)
        best = _refined_state(start, misfit, limits)
        if misfit(best) < INITIAL_STATE.much_better * before:
            return best
    return DEPOLARISED


def _opening(view: AxisSignals) -> AxisSignals:
    """Return the first part of a record: 1.5 times as long as to its second drive extreme."""
    last = max(int(view.drive.argmin()), int(view.drive.argmax()))
    count = min(len(view.drive), max(INITIAL_STATE.fewest_samples, 3 * last // 2))
    return view.part(count)


def _candidate_states(limits: tuple[float, float], rest: float) -> Iterator[InitialState]:
    """Yield excursions to either side, some followed by a smaller one to the other side."""
    yield InitialState((), rest)
    for limit, opposite in (limits, limits[::-1]):
        for size in np.linspace(0.0, 1.0, INITIAL_STATE.levels + 1)[1:]:
            for share in INNER:
                turns = np.array([size * limit, *((share * size * opposite,) if share else ())])
                yield InitialState(np.clip(turns, *limits), rest)


def _refined_state(
    start: InitialState, misfit: Callable[[InitialState], float], limits: tuple[float, float]
) -> InitialState:
    """Return the best state near ``start``, with as many turns and a free rest."""

    def initial_state(values: Array) -> InitialState:
        return InitialState(values[:-1], float(values[-1]))

    first = np.array([*start.turns, start.rest])
    steps = 0.05 * (limits[1] - limits[0]) * np.diag(np.where(first < 0.0, 1.0, -1.0))
    found = minimize(
        lambda values: misfit(initial_state(values)),
        first,
        method="Nelder-Mead",
        bounds=[limits] * len(first),
        options={
            "maxfev": INITIAL_STATE.refinements,
            "initial_simplex": np.vstack([first, first + steps]),
        },
    )
    return initial_state(found.x)


def evidence_of(axis: str, model: ScannerModel, observed: Record, number: int = 0) -> Evidence:
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
    if not (observed.scan or observed.depolarised):
        limit = limit.unprepared(len(view.measured) * view.sample_period)
    cells = RecordCells(limit.edges, len(view.drive), view.sample_period)
    part, exact = _repeated(observed, view.drive), observed.scan is not None
    cells = cells.repeating(view.drive, view.rates, part, exact=exact)
    return Evidence(playback, limit, untested).with_cells(cells, chain)


def _repeated(observed: Record, drive: Array) -> tuple[int, int] | None:
    """Samples from a scan's first line to before the end of its last, or where a drive repeats.

    None where no part of a drive does.
    """
    if observed.scan is None:
        part = repeated_part(drive)
        return part and part[:2]
    lines, count = phases(observed.scan).lines, fast_length(len(observed.drive))
    return min(lines.start, count), min(lines.stop, count)


def _other(axis: str, model: ScannerModel, observed: Record) -> Array:
    """Displacement (n,) in m of the other axis without coupling; zero where the model lacks it."""
    (other,) = (name for name in AXES if name != axis)
    still = np.zeros(fast_length(len(observed.drive)))
    if other not in model.axes:
        return still
    alone = evolve(chain_of(model.axis(other)), coupling=())
    played = _playback(alone, _axis_signals(observed, other, still), _known(other, model), observed)
    return played.displacement(evolve(alone, output=()))


def _axis_signals(observed: Record, axis: str, other: Array) -> AxisSignals:
    drive, measured = (signal[: len(other)] for signal in observed.signals(axis))
    rates = repetition_rates(observed)
    given = observed.name, observed.sample_period, drive, measured, other
    return AxisSignals(*given, rates=rates, intersample=observed.intersample)


def _playback(
    chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy], observed: Record
) -> Playback:
    begun = DEPOLARISED if observed.depolarised else estimate_initial_state(chain, view, known)
    return Playback(view, begun)


def _detection_limit(
    playback: Playback, chain: Chain, known: Sequence[ModelDiscrepancy]
) -> DetectionLimit:
    limit = _limit_of(chain, playback.view, known)
    between = error_between_levels(playback, chain)
    return limit.at_least(rms_by_band(between, limit.edges, playback.view.sample_period))


def _limit_of(chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy]) -> DetectionLimit:
    resonance = resonance_of(chain.model.vibration, view.sample_period)
    stated = chain.model.spread
    return detection_limit(known, view.measured, view.sample_period, resonance, stated)


def _untested(
    playback: Playback, chain: Chain, known: Sequence[ModelDiscrepancy], limit: DetectionLimit
) -> MotionByBand | None:
    """Motion at which the error is not known; none of a record that hardly moves."""
    moved = playback.displacement(chain)
    if np.ptp(moved) <= EVIDENCE.least_motion * np.linalg.norm(limit.noise):
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
