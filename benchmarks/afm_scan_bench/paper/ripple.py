"""The scanner's vibration, read off the image of a grating.

Each column of the image was scanned at the same time after the start of its line. Down a column an
oblique grating is a wave; how far it is shifted is how far the scanner was, whatever the columns
beside it say. So the columns' phases are the scanner's path within a line, also where vibration
makes it go back and forth.
"""

import numpy as np
from attrs import field, frozen

from afm_scan_ros.core.types import Array

LOWEST, HIGHEST, STEP = 250.0, 1000.0, 1.0
"""Frequencies, Hz, at which a ripple is looked for."""

SPANS = np.linspace(0.5, 4.0, 176)
"""Periods of the grating that a column may hold."""

HARMONICS = (1, 3)
"""Of a square wave, which bars half as wide as their pitch are."""

BEND = 3
"""Degree of the polynomial in time that is no ripple."""


@frozen
class Ripple:
    """A vibration within the lines: its frequency, Hz, and its amplitude along x, m."""

    frequency: float = field(metadata={"unit": "hz"})
    amplitude: float = field(metadata={"unit": "m"})


@frozen(eq=False)
class LinePath:
    """Where along x (m) the scanner was within its lines, against time (s); both (columns,)."""

    time: Array
    x: Array

    @property
    def shows_ripple(self) -> bool:
        """Whether a line is long enough, and its pixels many enough, for the band looked at."""
        step = float(self.time[1] - self.time[0])
        return step * len(self.time) * LOWEST >= 1.0 and step * HIGHEST <= 0.5  # noqa: PLR2004 - Nyquist

    def strongest(self) -> Ripple:
        """Return the ripple that explains most of the path."""
        tries = np.arange(LOWEST, HIGHEST + STEP, STEP)
        fits = [self._fit(frequency) for frequency in tries]
        best = int(np.argmin([residual for residual, _ in fits]))
        return Ripple(float(tries[best]), fits[best][1])

    def at(self, frequency: float) -> Ripple:
        """Return the ripple at a frequency, Hz, that is known from elsewhere."""
        return Ripple(frequency, self._fit(frequency)[1])

    def _fit(self, frequency: float) -> tuple[float, float]:
        """Fit a sine and a smooth bend; return the residual, and the sine's amplitude."""
        share = (self.time - self.time[0]) / np.ptp(self.time)
        bend = np.polynomial.chebyshev.chebvander(2.0 * share - 1.0, BEND)
        turn = 2.0 * np.pi * frequency * self.time
        design = np.column_stack([np.cos(turn), np.sin(turn), bend])
        found, _, _, _ = np.linalg.lstsq(design, self.x, rcond=None)
        residual = float(np.sum((self.x - design @ found) ** 2))
        return residual, float(np.hypot(found[0], found[1]))


def line_path(image: Array, period_x: float, duration: float) -> LinePath:
    """Return the path within a line from an image, shape (rows, columns), of an oblique grating.

    ``period_x`` is the grating's period along a line, m. A line lasts ``duration`` s at constant
    speed. Successive columns must lie less than half a period apart.
    """
    columns = image.shape[1]
    down = np.linspace(0.0, 1.0, image.shape[0])
    designs = (_waves(span * down) for span in SPANS)
    design = max(designs, key=lambda design: _explained(image, design))
    found, _, _, _ = np.linalg.lstsq(design, image, rcond=None)
    phases = np.unwrap(np.arctan2(-found[1], found[0]))
    time = (np.arange(columns) + 0.5) * duration / columns
    return LinePath(time, phases * period_x / (2.0 * np.pi))


def _waves(turns: Array) -> Array:
    """Return cosine and sine of each harmonic, and a constant, as columns."""
    angles = [2.0 * np.pi * harmonic * turns for harmonic in HARMONICS]
    waves = [wave for angle in angles for wave in (np.cos(angle), np.sin(angle))]
    return np.column_stack([*waves, np.ones_like(turns)])


def _explained(image: Array, design: Array) -> float:
    """Return the sum of squares that a fit of the design's columns to the image's explains."""
    basis, _ = np.linalg.qr(design)
    return float(np.sum((basis.T @ image) ** 2))
