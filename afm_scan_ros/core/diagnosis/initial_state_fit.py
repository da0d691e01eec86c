"""Estimates the initial hysteresis state of a record from the record itself.

A wrong initial state causes errors up to a micrometre until the drive exceeds the past extremes.
The part of the record up to both of its drive extremes is predicted from many initial states. The
depolarised state is kept unless another one leaves a much smaller residual.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from attrs import evolve
from scipy.optimize import minimize

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.playback import DEPOLARISED, InitialState, Playback
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy
from afm_scan_ros.core.types import Array

WITHIN_NOISE = 2.0
"""Mean square per band, in detection limits, up to which the depolarised state is kept."""
MUCH_BETTER = 0.2
"""Share of the depolarised state's misfit that another state must fall below."""
LEVELS, INNER = 8, (0.0, 0.4, 0.7, 1.0)
"""Extremes tried on either side, and the second extreme's share of the first."""
REFINEMENTS = 150
FEWEST_SAMPLES = 2000


def estimate_initial_state(
    chain: Chain, view: AxisSignals, known: Sequence[ModelDiscrepancy]
) -> InitialState:
    """Estimate the initial hysteresis state of one axis of a record."""
    surface = chain.model.hysteresis.forward
    opening = _opening(view)
    resonance = resonance_of(chain.model.vibration, view.sample_period)
    limit = detection_limit(known, opening.measured, view.sample_period, resonance)

    def misfit(initial_state: InitialState) -> float:
        normalised_residual = Evidence(Playback(opening, initial_state), limit).normalised_residual(
            chain
        )
        return float(np.mean(normalised_residual**2))

    limits = surface.lower, surface.upper
    before = misfit(DEPOLARISED)
    if before > WITHIN_NOISE * len(limit.rms):
        start = min(_candidate_states(limits, float(view.drive[0])), key=misfit)
        best = _refined_state(start, misfit, limits)
        if misfit(best) < MUCH_BETTER * before:
            return best
    return DEPOLARISED


def _opening(view: AxisSignals) -> AxisSignals:
    """Return the first part of a record: 1.5 times as long as to its second drive extreme."""
    last = max(int(view.drive.argmin()), int(view.drive.argmax()))
    count = min(len(view.drive), max(FEWEST_SAMPLES, 3 * last // 2))
    drive, measured, other = (s[:count] for s in (view.drive, view.measured, view.other))
    return evolve(view, drive=drive, measured=measured, other=other)


def _candidate_states(limits: tuple[float, float], rest: float) -> Iterator[InitialState]:
    """Yield excursions to either side, some followed by a smaller one to the other side."""
    yield InitialState((), rest)
    for limit, opposite in (limits, limits[::-1]):
        for size in np.linspace(0.0, 1.0, LEVELS + 1)[1:]:
            for share in INNER:
                inner = (share * size * opposite,) if share else ()
                yield InitialState((size * limit, *inner), rest)


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
        options={"maxfev": REFINEMENTS, "initial_simplex": np.vstack([first, first + steps])},
    )
    return initial_state(found.x)
