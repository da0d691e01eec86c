"""Features of a residual, from which fits of candidate effects start.

They are spectral lines, least-squares amounts of known shapes, and likely modes.
"""

import numpy as np
import scipy
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.types import Array

STANDS_OUT = 6.0
"""Times the median of its neighbourhood, in amplitude."""
NEIGHBOURHOOD = 101  # lines
MOST = 4

DAMPINGS = (0.005, 0.02, 0.06)
SPACING = 0.8
"""Of the frequencies at which a mode is sought, in units of the resonance's damping."""
REACH = 6.0
"""Half-widths of the resonance on either side of it that are evaluated."""
FEWEST = 16  # lines, to fit four numbers to
LOWEST = 5.0  # Hz
APART = 1.15  # least ratio of the frequencies of two modes

Spectrum = NDArray[np.complex128]


@frozen(eq=False)
class ResidualFeatures:
    """Features of one axis of one record.

    ``drive`` (V), measured ``displacement`` and ``residual`` (m) have shape (n,), as has ``other``,
    the other axis' displacement (m). ``sample_period`` is in s. ``prominent`` are the frequencies
    (Hz) of the residual's largest spectral lines, see ``prominent_lines``. Noise does not explain
    the first of them where one is ``beyond_noise``.
    """

    sample_period: float
    drive: Array
    displacement: Array
    residual: Array
    other: Array
    prominent: tuple[float, ...]
    beyond_noise: bool = False

    def at(self, scale: Scale) -> "ResidualFeatures":
        """Return the same features in the units of the reference scanner."""
        return ResidualFeatures(
            self.sample_period / scale.time,
            self.drive / scale.voltage,
            self.displacement / scale.length,
            self.residual / scale.length,
            self.other / scale.length,
            tuple(line * scale.time for line in self.prominent),
            self.beyond_noise,
        )

    @property
    def duration(self) -> float:
        """Length of the record, s."""
        return len(self.residual) * self.sample_period


def prominent_lines(
    signal: Array, sample_period: float, most: int | None = MOST
) -> tuple[float, ...]:
    """Frequencies (Hz) of the lines of a signal (n,) that stand out, the largest first."""
    size = np.abs(np.fft.rfft(signal * scipy.signal.windows.hann(len(signal), sym=False)))
    inner = size[1:-1]
    peaks = (inner > size[:-2]) & (inner >= size[2:])
    loud = inner > STANDS_OUT * scipy.ndimage.median_filter(inner, NEIGHBOURHOOD, mode="nearest")
    found = 1 + np.flatnonzero(peaks & loud)
    largest = found[np.argsort(size[found])[::-1][:most]]
    return tuple(float(k / (len(signal) * sample_period)) for k in largest)


def amounts(residual: Array, *shapes: Array) -> Array:
    """Least-squares amount of each shape (n,) in a residual (n,), an offset apart; or 0."""
    centred = np.stack([shape - shape.mean() for shape in shapes], axis=1)
    size = np.linalg.norm(centred, axis=0)
    size[size == 0.0] = 1.0
    found, *_ = np.linalg.lstsq(centred / size, residual - residual.mean(), rcond=None)
    return np.asarray(found / size)


@frozen
class CandidateMode:
    """A resonance at a ``frequency`` in Hz, of a ``damping``."""

    frequency: float
    damping: float


def likely_modes(
    moved: Array, residual: Array, sample_period: float, most: int
) -> list[CandidateMode]:
    """Resonances by which the ratio of residual to motion, both (n,), bends most; best first.

    Around each frequency the ratio is fitted by a straight line and a resonance's
    1 / (ζ + j (ω/ω₀ - 1)), all complex, and ranked by what the latter explains of the residual.
    """
    window = scipy.signal.windows.hann(len(residual), sym=False)
    through, beyond = (np.fft.rfft(window * signal) for signal in (moved, residual))
    spacing, highest = 1.0 / (len(residual) * sample_period), 0.4 / sample_period
    ranked: list[tuple[float, CandidateMode]] = []
    for damping in DAMPINGS:
        lowest = max(FEWEST * spacing / (2.0 * REACH * damping), LOWEST)
        count = max(int(np.log(max(highest / lowest, 1.0)) / (SPACING * damping)), 0)
        for frequency in lowest * np.exp(SPACING * damping * np.arange(count)):
            mode = CandidateMode(float(frequency), damping)
            ranked.append((_explained(mode, through, beyond, spacing), mode))
    ranked.sort(key=lambda each: -each[0])
    return _apart([mode for gain, mode in ranked if gain > 0.0], most)


def modes_or_usual(
    moved: Array, features: ResidualFeatures, usual: tuple[CandidateMode, ...]
) -> tuple[CandidateMode, ...]:
    """As many likely modes as there are usual ones, which stand in for those that none shows."""
    found = likely_modes(moved, features.residual, features.sample_period, len(usual))
    return (*found, *usual[: len(usual) - len(found)])


def _explained(mode: CandidateMode, through: Spectrum, beyond: Spectrum, spacing: float) -> float:
    """Energy of the residual that the resonance explains beyond a straight line."""
    middle, reach = mode.frequency / spacing, REACH * mode.damping
    first, last = int(middle * max(1.0 - reach, 0.0)), int(middle * (1.0 + reach)) + 2
    near, rest = through[first:last], beyond[first:last]
    away = np.arange(first, first + len(near)) / middle - 1.0
    shapes = np.stack((near, away * near, near / (mode.damping + 1j * away)))
    inner, share = shapes.conj() @ shapes.T, shapes.conj() @ rest
    if np.linalg.matrix_rank(inner, hermitian=True) < len(shapes):
        return 0.0
    straight = np.linalg.solve(inner[:2, :2], np.column_stack((inner[:2, 2], share[:2])))
    own, left_over = (inner[2, 2], share[2]) - inner[2, :2] @ straight
    return float(np.abs(left_over) ** 2 / own.real)


def _apart(modes: list[CandidateMode], most: int) -> list[CandidateMode]:
    chosen: list[CandidateMode] = []
    for mode in modes:
        ratios = (mode.frequency / other.frequency for other in chosen)
        if all(max(ratio, 1.0 / ratio) > APART for ratio in ratios):
            chosen.append(mode)
        if len(chosen) == most:
            break
    return chosen
