"""Where a resonance may lie that the model lacks: a first look, before any fit."""

import numpy as np
import scipy
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array

DAMPINGS = (0.005, 0.02, 0.06)
SPACING = 1.0
"""Of frequencies that are tried, in units of the resonance's damping."""
REACH = 6.0
"""Half-widths of the resonance on either side of it that are looked at."""
FEWEST = 16  # lines, to tell four numbers from
LOWEST = 5.0  # Hz
APART = 1.15  # ratio of frequencies

Spectrum = NDArray[np.complex128]


@frozen
class Mode:
    """A resonance at a ``frequency`` in Hz, of a ``damping``."""

    frequency: float
    damping: float


def likely_modes(moved: Array, residual: Array, sample_period: float, most: int) -> list[Mode]:
    """Resonances by which the ratio of residual to motion, both (n,), bends most; best first.

    Around each frequency the ratio is fitted by a straight line and a resonance's
    1 / (ζ + j (ω/ω₀ - 1)), all complex, and ranked by what the latter explains of the residual.
    """
    window = scipy.signal.windows.hann(len(residual), sym=False)
    through, left = (np.fft.rfft(window * signal) for signal in (moved, residual))
    spacing, highest = 1.0 / (len(residual) * sample_period), 0.4 / sample_period
    ranked: list[tuple[float, Mode]] = []
    for damping in DAMPINGS:
        lowest = max(FEWEST * spacing / (2.0 * REACH * damping), LOWEST)
        count = max(int(np.log(max(highest / lowest, 1.0)) / (SPACING * damping)), 0)
        for frequency in lowest * np.exp(SPACING * damping * np.arange(count)):
            mode = Mode(float(frequency), damping)
            ranked.append((_explained(mode, through, left, spacing), mode))
    ranked.sort(key=lambda each: -each[0])
    return _apart([mode for gain, mode in ranked if gain > 0.0], most)


def _explained(mode: Mode, through: Spectrum, left: Spectrum, spacing: float) -> float:
    """Energy of the residual that the resonance explains beyond a straight line."""
    middle, reach = mode.frequency / spacing, REACH * mode.damping
    first, last = int(middle * max(1.0 - reach, 0.0)), int(middle * (1.0 + reach)) + 2
    near, rest = through[first:last], left[first:last]
    away = np.arange(first, first + len(near)) / middle - 1.0
    shapes = np.stack((near, away * near, near / (mode.damping + 1j * away)))
    inner, share = shapes.conj() @ shapes.T, shapes.conj() @ rest
    if np.linalg.matrix_rank(inner, hermitian=True) < len(shapes):
        return 0.0
    straight = np.linalg.solve(inner[:2, :2], np.column_stack((inner[:2, 2], share[:2])))
    own, left_over = (inner[2, 2], share[2]) - inner[2, :2] @ straight
    return float(np.abs(left_over) ** 2 / own.real)


def _apart(modes: list[Mode], most: int) -> list[Mode]:
    chosen: list[Mode] = []
    for mode in modes:
        ratios = (mode.frequency / other.frequency for other in chosen)
        if all(max(ratio, 1.0 / ratio) > APART for ratio in ratios):
            chosen.append(mode)
        if len(chosen) == most:
            break
    return chosen
