"""Backlash: play between what the piezo moves and what the sensor sees.

Equation: x follows x₀ only when pushed, x ← min(max(x, x₀ - w/2), x₀ + w/2), w in m; at first it
lies in the middle of its play. Source: a worn joint, a loose sample holder. Assumptions: x rests
by friction while not pushed, and is light enough to act back on nothing.
"""

from collections.abc import Iterator

import numpy as np

from afm_scan_ros.core.catalogue.amounts import amounts
from afm_scan_ros.core.catalogue.entry import Entry, Form, Parameter
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compiled import compiled
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.types import Array

WIDTH = Parameter("width", "m", 0.0, 5e-6, 1e-12)
STEEPNESS = 100.0


@compiled
def _apply(follower: float, half: float, block: Array, result: Array) -> float:
    for k in range(block.size):
        follower = min(max(follower, block[k] - half), block[k] + half)
        result[k] = follower
    return follower


@compiled
def _invert(state: Array, half: float, block: Array, result: Array) -> None:
    lead, last = state
    for k in range(block.size):
        lead = min(max(lead + STEEPNESS * (block[k] - last), -half), half)
        last = block[k]
        result[k] = last + lead
    state[:] = lead, last


class Backlash:
    """Play of one width (m); the state is where the follower lies (m).

    The inverse leads by half the width, so at each reversal it has to cross the play. It does so
    while its target moves by 1/STEEPNESS of the width, which is its error: a jump would follow
    any rounding of a target at rest. Its state, shape (2,), is lead and last target (m).
    """

    def __init__(self, width: float) -> None:
        self._half = 0.5 * width

    def at_rest(self) -> float:
        """Position of the follower in the middle."""
        return 0.0

    def apply(self, state: float, block: Array) -> tuple[float, Array]:
        """Displacement behind the play for that before it, both (n,) in m."""
        result = np.empty_like(block)
        return _apply(state, self._half, block, result), result

    def inverse_at_rest(self) -> Array:
        """State in the middle."""
        return np.zeros(2)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Displacement before the play that gives ``block`` behind it, both (n,) in m."""
        state, result = state.copy(), np.empty_like(block)
        _invert(state, self._half, block, result)
        return state, result

    def finish(self, state: Array) -> Array:  # noqa: ARG002 - Effect's
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


def insert(chain: Chain, values: Array) -> Chain:
    """Put play before the sensor: width (m)."""
    (width,) = values
    return chain.with_output(lambda _: Backlash(width))


def starts(clues: Clues) -> Iterator[tuple[float]]:
    """Width that the residual shows if the play is small beside the motion, and a tenth of it."""
    little = 1e-3 * float(np.ptp(clues.displacement))
    lag = Backlash(little).apply(0.0, clues.displacement)[1] - clues.displacement
    width = WIDTH.nearest(little * amounts(clues.residual, lag)[0])
    yield (max(width, 1e-9),)
    yield (max(0.1 * width, 1e-10),)


ENTRY = Entry(
    name="backlash",
    equation="x follows x0 only when pushed, from +-width / 2 away",
    needs="reversals at several places and motions as small as the width",
    confusable=("hysteretic_stiffness", "parameter_shift", "static_nonlinearity"),
    experiment="amplitudes",
    remedy="feedforward",
    advice="the drive crosses the play at every reversal: it asks for a turnaround, and for an"
    " amplifier as steep as the crossing; an axis that holds still lies anywhere in its play",
    forms=(Form("", (WIDTH,), insert, starts, (0.0,)),),
)
