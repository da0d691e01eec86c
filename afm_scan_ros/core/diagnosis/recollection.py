"""The memory with which a record began, found in the record itself.

A wrong memory costs as much as a micrometre until the drive has gone beyond what is remembered.
So the first part of the record, up to where the drive has been at both of its extremes, is
predicted from many memories; depolarised is kept unless another leaves far less.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from attrs import evolve
from scipy.optimize import minimize

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.floor import floor_of
from afm_scan_ros.core.diagnosis.memory import DEPOLARISED, Memory
from afm_scan_ros.core.diagnosis.observation import View
from afm_scan_ros.core.diagnosis.playback import Playback
from afm_scan_ros.core.known_error import KnownError
from afm_scan_ros.core.types import Array

QUIET = 2.0
"""Largest mean square excess of a band, up to which the depolarised memory is not doubted."""
FAR_LESS = 0.2
"""Share of the depolarised memory's misfit that another must fall below."""
LEVELS, INNER = 8, (0.0, 0.4, 0.7, 1.0)
"""Extremes tried on either side, and the second extreme's share of the first."""
POLISH = 150
FEWEST = 2000


def recollect(chain: Chain, view: View, known: Sequence[KnownError]) -> Memory:
    """Estimate the memory with which one axis of a record began."""
    surface = chain.model.hysteresis.forward
    opening = _opening(view)
    floor = floor_of(known, opening.measured, view.sample_period)

    def misfit(memory: Memory) -> float:
        excess = Evidence(Playback(opening, memory), floor).excess(chain)
        return float(np.mean(excess**2))

    limits = surface.lower, surface.upper
    before = misfit(DEPOLARISED)
    if before > QUIET * len(floor.rms):
        start = min(_memories(limits, float(view.drive[0])), key=misfit)
        best = _polished(start, misfit, limits)
        if misfit(best) < FAR_LESS * before:
            return best
    return DEPOLARISED


def _opening(view: View) -> View:
    """Return the record up to where its drive has been at both extremes, and half as much again."""
    last = max(int(view.drive.argmin()), int(view.drive.argmax()))
    count = min(len(view.drive), max(FEWEST, 3 * last // 2))
    drive, measured, other = (s[:count] for s in (view.drive, view.measured, view.other))
    return evolve(view, drive=drive, measured=measured, other=other)


def _memories(limits: tuple[float, float], rest: float) -> Iterator[Memory]:
    """Yield excursions to either side, some with a lesser one to the other side after them."""
    yield Memory((), rest)
    for limit, opposite in (limits, limits[::-1]):
        for size in np.linspace(0.0, 1.0, LEVELS + 1)[1:]:
            for share in INNER:
                inner = (share * size * opposite,) if share else ()
                yield Memory((size * limit, *inner), rest)


def _polished(
    start: Memory, misfit: Callable[[Memory], float], limits: tuple[float, float]
) -> Memory:
    """Return the best memory near one of as many turns, its rest free."""

    def memory(values: Array) -> Memory:
        return Memory(values[:-1], float(values[-1]))

    first = np.array([*start.turns, start.rest])
    steps = 0.05 * (limits[1] - limits[0]) * np.diag(np.where(first < 0.0, 1.0, -1.0))
    found = minimize(
        lambda values: misfit(memory(values)),
        first,
        method="Nelder-Mead",
        bounds=[limits] * len(first),
        options={"maxfev": POLISH, "initial_simplex": np.vstack([first, first + steps])},
    )
    return memory(found.x)
