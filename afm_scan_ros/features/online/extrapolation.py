"""Extrapolates slowly changing values from line to line, by the method that has served best so far.

A value of line k is known when the correction of line k + ``delay`` is decided. A polynomial of
degree 0, 1 or 2 in the line number is fitted to the values so far, with weights that fall by the
factor lambda a line (discounted least squares: Morrison, Introduction to Sequential Smoothing and
Prediction, 1969, chapter 9), and extrapolated. A drift of constant speed is met without a lag by
degree 1, one of constant acceleration by degree 2.

**Stability.** The correction acts on the value with a gain that is wrong by a share epsilon, so
that z = d - epsilon u, for a disturbance d and a correction u. Every method is a sum of past values
with weights f, so |u| <= F max|z| with F = sum|f|. As long as epsilon F < 1, |u| stays below
F max|d| / (1 - epsilon F): for any delay, and whichever method is chosen at each line. This is the
small-gain theorem in the maximum norm. The fast methods have F = 1 / ``LARGEST_GAIN_ERROR``.
"""

from collections.abc import Callable
from functools import lru_cache
from math import ceil, log

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array

LARGEST_GAIN_ERROR = 0.2
"""The feedback is stable with any smaller error of the gain from a correction to its effect."""
LARGEST_SUM = 1.0 / LARGEST_GAIN_ERROR
"""Of the sizes of the weights."""
NOISE_SHARE = 0.1
"""Share by which the slow methods raise the rms of an error that is another in each line."""
DEGREES = (0, 1, 2)
FORGOTTEN = 1e-3
"""Weight of a value below which it is left out."""
FASTEST, SLOWEST = 0.01, 0.99
"""Bounds of lambda: the last value alone, and a memory of a hundred lines."""
RESOLUTION = 1e-3
"""Of lambda."""
GRID = 2000
"""Frequencies at which a response is computed."""
ROUNDING = 1e-9
"""Of sums of weights."""
KEPT_SCORE = 0.9
"""Share of a method's past squared errors that counts on from line to line: ten lines' memory."""


@frozen
class Method:
    """Extrapolation by ``delay`` lines of a polynomial of some degree, fitted with ``decay``."""

    degree: int
    decay: float
    delay: int

    @property
    def memory(self) -> int:
        """Largest number of values that count."""
        return max(self.degree + 1, ceil(log(FORGOTTEN) / log(self.decay)))

    @property
    def steady_weights(self) -> Array:
        """Weights of values, the newest first, once there are enough, shape (memory,)."""
        return self.weights(self.memory)

    def weights(self, count: int) -> Array:
        """Weights of the last ``count`` values, the newest first, shape (count,)."""
        return _weights(self.degree, self.decay, self.delay, count)

    def usable(self, count: int) -> bool:
        """Whether so many values determine the polynomial, with weights small enough."""
        return count > self.degree and _is_stable(self.weights(min(count, self.memory)))

    @property
    def bandwidth(self) -> float:
        """Frequency (1 / lines) below which a disturbance is reduced: |1 - e^(-i w delay) F| < 1.

        F is the response of the weights to e^(i w line).
        """
        omega = np.linspace(0.0, np.pi, GRID)[1:]
        weights = self.steady_weights
        response = np.exp(-1j * np.outer(omega, self.delay + np.arange(weights.size))) @ weights
        grows = np.abs(1.0 - response) >= 1.0
        return float(omega[np.argmax(grows)] / (2.0 * np.pi))

    def extrapolated(self, values: Array) -> Array:
        """Value ``delay`` lines after the last one, of values (channels, lines), oldest first."""
        used = values[:, ::-1][:, : self.memory]
        return np.asarray(used @ self.weights(used.shape[1]))


@frozen(eq=False)
class Known:
    """What is known of each channel by some line.

    ``values`` of the last lines, oldest first, (channels, lines). ``pending`` are the methods'
    extrapolations for the next ``delay`` lines, the next one first, (delay, methods, channels);
    NaN where a method had none. ``squares`` (methods, channels) and ``counted`` (methods, 1) are
    their squared errors so far, and in how many lines, both forgotten slowly.
    """

    lines: int
    values: Array
    pending: Array
    squares: Array
    counted: Array


class Extrapolation:
    """Extrapolates channels by ``delay`` lines; without any success so far, to zero.

    Below ``bandwidth`` (1 / lines), the largest of the methods', disturbances can be reduced.

    Each line, the method is taken whose extrapolations have had the least squared error, channel
    by channel. Extrapolating zero, which is no feedback, is one of the methods. So noise is not fed
    back: it cannot be extrapolated better than by its mean.
    """

    def __init__(self, delay: int, channels: int) -> None:
        self._channels = channels
        self._delay = delay
        self.methods = methods(delay)
        self._memory = max(each.memory for each in self.methods)
        self.bandwidth = max(each.bandwidth for each in self.methods)

    def at_rest(self) -> Known:
        """Nothing is known."""
        rows = len(self.methods) + 1
        pending = np.full((self._delay, rows, self._channels), np.nan)
        pending[:, 0] = 0.0
        nothing = np.zeros((rows, self._channels))
        return Known(0, np.empty((self._channels, 0)), pending, nothing, np.zeros((rows, 1)))

    def step(self, before: Known, values: Array) -> tuple[Known, Array]:
        """Take the next line's values, (channels,); return those of ``delay`` lines later."""
        squares, counted = _scored(before, values)
        lines = before.lines + 1
        kept = np.column_stack([before.values, values])[:, -self._memory :]
        ahead = np.full_like(before.pending[0], np.nan)
        ahead[0] = 0.0
        for row, method in enumerate(self.methods, 1):
            if method.usable(lines):
                ahead[row] = method.extrapolated(kept)
        pending = np.concatenate((before.pending[1:], ahead[None]))
        known = Known(lines, kept, pending, squares, counted)
        return known, _best(known)


def methods(delay: int) -> tuple[Method, ...]:
    """For each degree, the fastest method that is stable, and a slower one that passes no noise."""
    found = [
        _fastest(degree, delay, suits) for degree in DEGREES for suits in (_is_stable, _is_calm)
    ]
    return tuple(method for method in found if method is not None)


def _is_stable(weights: Array) -> bool:
    return bool(np.abs(weights).sum() <= LARGEST_SUM * (1.0 + ROUNDING))


def _is_calm(weights: Array) -> bool:
    return bool(1.0 + np.sum(weights**2) <= (1.0 + NOISE_SHARE) ** 2)


def _fastest(degree: int, delay: int, suits: Callable[[Array], bool]) -> Method | None:
    """Return the method of the least decay whose weights suit; None where no decay's do."""
    low, high = FASTEST, SLOWEST
    if not suits(Method(degree, high, delay).steady_weights):
        return None
    while high - low > RESOLUTION:
        middle = 0.5 * (low + high)
        if suits(Method(degree, middle, delay).steady_weights):
            high = middle
        else:
            low = middle
    return Method(degree, high, delay)


@lru_cache(maxsize=10_000)
def _weights(degree: int, decay: float, delay: int, count: int) -> Array:
    ages = np.arange(count)
    unit = float(delay + count)
    powers = np.arange(degree + 1)
    root = decay ** (0.5 * ages)
    basis, triangle = np.linalg.qr(root[:, None] * (-ages[:, None] / unit) ** powers)
    ahead = (delay / unit) ** powers
    weights: Array = root * (basis @ np.linalg.solve(triangle.T, ahead))
    return weights


def _scored(before: Known, values: Array) -> tuple[Array, Array]:
    """Return squares and numbers of lines with the errors of what was extrapolated for a line."""
    missed = before.pending[0] - values
    known = ~np.isnan(missed)
    squares = KEPT_SCORE * before.squares + np.where(known, missed, 0.0) ** 2
    return squares, KEPT_SCORE * before.counted + known[:, :1]


def _best(known: Known) -> Array:
    """Return each channel's newest extrapolation by the method of the least mean square."""
    ahead = known.pending[-1]
    scored = (known.counted > 0.0) & ~np.isnan(ahead)
    mean = np.divide(known.squares, known.counted, out=np.full_like(ahead, np.inf), where=scored)
    best = np.argmin(mean, axis=0)
    chosen: Array = ahead[best, np.arange(best.size)]
    return chosen
