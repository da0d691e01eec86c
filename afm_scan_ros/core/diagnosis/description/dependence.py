"""How a residual goes with where the scanner is, how it moves, and how long it has moved."""

import numpy as np
from attrs import frozen
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from afm_scan_ros.core.types import Array

BINS = 60
NEAR = 32
"""Share of the record, one in so many, over which its motion's amplitude is taken."""
TREMBLE = 1e-3
"""Share of the whole motion that a turn must reach to be one."""


@frozen(eq=False)
class Dependence:
    """Mean and rms (m) of a residual in bins of a quantity, at their ``centres``; all (bins,).

    ``unit`` is the quantity's. ``share`` of the mean square is explained by the bins' means.
    Empty bins are left out.
    """

    unit: str
    centres: Array
    mean: Array
    rms: Array
    count: NDArray[np.int64]
    share: float


def dependences(residual: Array, moved: Array, sample_period: float) -> dict[str, Dependence]:
    """Bin a residual (n,) by what the motion ``moved`` (n,) in m, as predicted, does meanwhile."""
    quantities: dict[str, tuple[str, Array]] = {
        "position": ("m", moved),
        "speed": ("m/s", np.asarray(np.gradient(moved, sample_period))),
        "travel": ("m", _travel(moved)),
        "amplitude": ("m", _amplitude(moved)),
        "time": ("s", np.asarray(np.arange(len(moved)) * sample_period)),
    }
    return {name: _binned(residual, *of) for name, of in quantities.items()}


def _binned(residual: Array, unit: str, quantity: Array) -> Dependence:
    edges = np.linspace(quantity.min(), quantity.max(), BINS + 1)
    where = np.clip(np.searchsorted(edges, quantity, "right") - 1, 0, BINS - 1)
    count = np.bincount(where, minlength=BINS)
    held = count > 0
    number = count[held]
    mean = np.bincount(where, residual, BINS)[held] / number
    square = np.bincount(where, residual**2, BINS)[held] / number
    whole = max(float(residual @ residual), np.finfo(float).tiny)
    centres = (0.5 * (edges[1:] + edges[:-1]))[held]
    return Dependence(unit, centres, mean, np.sqrt(square), number, float(number @ mean**2) / whole)


def _travel(moved: Array) -> Array:
    """How far (m) it has gone since it last turned round: what hysteresis and play depend on."""
    turns = [0, *_turns(moved)]
    lengths = np.diff([*turns, len(moved)])
    return np.asarray(np.abs(moved - np.repeat(moved[turns], lengths)))


def _turns(moved: Array) -> list[int]:
    """Samples at which a motion turns round, tremble aside."""
    least = TREMBLE * float(np.ptp(moved))
    extremes = 1 + np.flatnonzero(np.diff(np.sign(np.diff(moved))))
    turns: list[int] = []
    for sample in extremes:
        if abs(moved[sample] - moved[turns[-1] if turns else 0]) > least:
            turns.append(int(sample))
    return turns


def _amplitude(moved: Array) -> Array:
    """Half of peak to peak (m) of the motion near each sample."""
    window = max(3, len(moved) // NEAR)
    return np.asarray(0.5 * (maximum_filter1d(moved, window) - minimum_filter1d(moved, window)))
