"""The optimal inverse of a linear system with preview, for whole trajectories and streams.

Equation: U/X_d = G* / (G*G + R/Q), Croft, Shed and Devasia (2001), Eq. 22, with G the response at
the samples. Its impulse response extends into the future, because G has zeros in the right half
plane, and into the past, because G has memory.

It is applied as a convolution with one kernel by overlap-save: all but the first samples of a
segment's cyclic convolution equal the linear one (A. V. Oppenheim and R. W. Schafer, Discrete-Time
Signal Processing, ch. 8). Segments of some kernel lengths fit into a processor's cache.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Protocol

import numpy as np
from attrs import field, frozen
from attrs.validators import ge, gt
from numpy.typing import NDArray
from scipy import fft

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

Spectrum = NDArray[np.complex128]

LENGTHS, SAMPLES = 10, 2**13
"""Longest segment, in kernel lengths and in samples; longer ones exceed the cache."""
ROWS = 4
"""Segments transformed together."""
LONGER = 1.1
"""Largest length of a power of two, relative to the length needed."""
CACHED = 16
"""Transforms of the kernel in the cache; the blocks of a stream have few sizes."""


class Convolution:
    """Filter by a kernel of shape (taps,)."""

    def __init__(self, kernel: Array) -> None:
        self.taps = len(kernel)
        self._spectrum: Callable[[int], Spectrum] = lru_cache(CACHED)(partial(fft.rfft, kernel))

    def valid(self, signal: Array) -> Array:
        """Sums that the whole kernel takes part in: (n - taps + 1,) for a signal (n,), or none."""
        lost = self.taps - 1
        count = max(len(signal) - lost, 0)
        segments = -(-count // max(LENGTHS * self.taps, SAMPLES))
        if not count:
            return np.empty(0)
        size = _fast(-(-count // segments) + lost)
        step = size - lost
        padded = np.zeros(segments * step + lost)
        padded[: len(signal)] = signal
        rows = np.ndarray((segments, size), buffer=padded, strides=(8 * step, 8))
        result = np.empty((segments, step))
        for first in range(0, segments, ROWS):
            part = slice(first, first + ROWS)
            result[part] = _cyclic(rows[part], self._spectrum(size))[:, lost:]
        return result.ravel()[:count]


def _cyclic(rows: Array, spectra: Spectrum) -> Array:
    """Cyclic convolution of each row, shape (rows, size), with the kernels of the spectra."""
    products = fft.rfft(rows)
    products *= spectra
    return np.asarray(fft.irfft(products, rows.shape[-1], overwrite_x=True))


def _fast(least: int) -> int:
    """Length of a transform; a power of two is the fastest, though it be somewhat longer."""
    power = 1 << (least - 1).bit_length()
    return power if power <= LONGER * least else int(fft.next_fast_len(least, real=True))


class Weight(Protocol):
    """R/Q of Croft, Shed and Devasia (2001), Eq. 21, in units of |G(0)|²."""

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega`` (rad/s, up to π/T), same shape."""
        ...


@frozen
class SmoothWeight:
    """R/Q = (ω̃ / 2π corner)^(2 order) with ω̃ = (2/T) sin(ωT/2); ``corner`` in Hz.

    Zero at rest. Rational, so the inverse's response dies out exponentially both ways.
    """

    corner: float = field(converter=float, validator=gt(0.0))
    order: int = field(validator=ge(1))

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega``."""
        sampled = 2.0 / sample_period * np.sin(0.5 * omega * sample_period)
        result: Array = (sampled / (2.0 * np.pi * self.corner)) ** (2 * self.order)
        return result


@frozen
class RelativeWeight:
    """A smooth weight for any scanner: its ``corner`` is so many times the first resonance.

    On the default plant, tracking 250 lines a second errs by less than 0.9 % for any corner from
    4.4 to 15 (``afm-scan bench tradeoff``); a larger one excites modes that the model lacks.
    """

    corner: float = field(default=11.0, converter=float, validator=gt(0.0))
    order: int = field(default=2, validator=ge(1))

    def at(self, resonance: float) -> SmoothWeight:
        """Return the weight for a first resonance (Hz)."""
        return SmoothWeight(self.corner * resonance, self.order)


@frozen(eq=False)
class MultipliedWeight:
    """R/Q times ``squared``, |m|² at angular frequencies (rad/s), of a system m G.

    Its optimal inverse is that of G and then 1/m, exactly: the modified trajectory stays as it was.
    """

    weight: Weight
    squared: Callable[[Array], Array]

    def ratio(self, omega: Array, sample_period: float) -> Array:
        """R/Q at the angular frequencies ``omega``."""
        return self.weight.ratio(omega, sample_period) * self.squared(omega)


Response = Callable[[Array], NDArray[np.complex128]]

SHORTEST, LONGEST = 2**12, 2**18  # samples of the impulse response
NEGLIGIBLE = 1e-11  # share of the impulse response that may be cut off
ACCEPTED = 1e-6  # share that may lie beyond half of the longest response


@frozen(eq=False)
class Kernel:
    """Impulse response of an inverse, shape (n,): u[k] = Σ values[centre + i] x_d[k - i].

    ``values[centre]`` weighs the sample's own target, those before it the targets to come.
    """

    values: Array
    centre: int

    def tail_ahead(self, preview: int) -> float:
        """Share Σ|·| of the response that lies more than ``preview`` samples ahead."""
        size = np.abs(self.values)
        return float(size[: max(self.centre - preview, 0)].sum() / size.sum())

    def tail_behind(self, memory: int) -> float:
        """Share Σ|·| of the response that lies more than ``memory`` samples back."""
        size = np.abs(self.values)
        return float(size[self.centre + memory + 1 :].sum() / size.sum())

    def preview_needed(self, tail: float) -> int:
        """Fewest samples of preview that leave no more than the share ``tail`` ahead of them."""
        size = np.abs(self.values)
        ahead = np.cumsum(size[: self.centre]) / size.sum()
        return self.centre - int(np.searchsorted(ahead, tail, side="right"))

    def cut(self, ahead: int, behind: int) -> "Kernel":
        """Kernel of at most ``ahead`` samples of preview and ``behind`` of memory."""
        first = max(self.centre - ahead, 0)
        return Kernel(self.values[first : self.centre + behind + 1], self.centre - first)

    def trimmed(self) -> "Kernel":
        """Kernel without the ends that hold a negligible share of it."""
        share = np.cumsum(np.abs(self.values)) / np.abs(self.values).sum()
        first, last = np.searchsorted(share, [0.5 * NEGLIGIBLE, 1.0 - 0.5 * NEGLIGIBLE])
        return self.cut(max(self.centre - int(first), 0), max(int(last) - self.centre, 0))


def sampled_kernel(response: Response, weight: Weight, sample_period: float, size: int) -> Kernel:
    """Impulse response of the optimal inverse by frequency sampling on ``size`` points (even)."""
    omega = np.linspace(0.0, np.pi / sample_period, size // 2 + 1)
    gain = response(omega)
    cost = np.abs(gain[0]) ** 2 * weight.ratio(omega, sample_period)
    inverse = gain.conj() / (np.abs(gain) ** 2 + cost)
    return Kernel(np.fft.fftshift(np.fft.irfft(inverse, size)), size // 2)


def optimal_kernel(response: Response, weight: Weight, sample_period: float) -> Kernel:
    """Impulse response of the optimal inverse, on a grid long enough to hold both its ends.

    Raises InputError where it does not die out, as under a weight with a step, stating the tail.
    """
    size = SHORTEST
    while True:
        kernel = sampled_kernel(response, weight, sample_period, size)
        tail = kernel.tail_ahead(size // 4) + kernel.tail_behind(size // 4)
        if tail <= NEGLIGIBLE or size == LONGEST:
            break
        size *= 2
    if tail > ACCEPTED:
        raise InputError(
            f"the inverse's response does not die out: {tail:.2g} of it still lies more than"
            f" {size // 4 * sample_period:.2g} s away, beyond any preview: choose a smooth weight"
        )
    return kernel.trimmed()


class OptimalInverse:
    """Filter by a kernel, as a stream that looks ``preview`` samples ahead, or all at once.

    The state is the run of targets still needed, from rest on. The last one is taken as held.
    """

    def __init__(self, kernel: Kernel, preview: int) -> None:
        self.kernel = kernel
        self.cut = kernel.cut(preview, len(kernel.values))
        """What a stream has of the kernel."""
        self.preview = self.cut.centre
        self._convolution = Convolution(self.cut.values)

    def at_rest(self) -> Array:
        """State before sample 0."""
        return np.zeros(self._convolution.taps - 1 - self.preview)

    def invert(self, state: Array, block: Array) -> tuple[Array, Array]:
        """Inputs for the targets whose preview is complete with ``block``."""
        signal = np.concatenate((state, block))
        result = self._convolution.valid(signal)
        return signal[len(result) :].copy(), result

    def finish(self, state: Array) -> Array:
        """Inputs still owed, the last target being held."""
        last = state[-1] if len(state) else 0.0
        return self.invert(state, np.full(self.preview, last))[1]

    def invert_whole(self, targets: Array) -> Array:
        """Inputs for a whole trajectory, every sample of it known in advance, both (n,)."""
        kernel = self.kernel
        before = np.zeros(len(kernel.values) - 1 - kernel.centre)
        after = np.full(kernel.centre, targets[-1])
        return Convolution(kernel.values).valid(np.concatenate((before, targets, after)))


class OptimalInverses:
    """Streams of several axes, each with its own optimal inverse, that look equally far ahead.

    The state is the run of targets still needed, (axes, n). Short blocks share one transform.
    """

    def __init__(self, inverses: Sequence[OptimalInverse]) -> None:
        cuts = [inverse.cut for inverse in inverses]
        self.preview = max(cut.centre for cut in cuts)
        behind = max(len(cut.values) - cut.centre for cut in cuts)
        kernels = np.zeros((len(cuts), self.preview + behind))
        for row, cut in zip(kernels, cuts, strict=True):
            first = self.preview - cut.centre
            row[first : first + len(cut.values)] = cut.values
        self._before = np.zeros((len(cuts), behind - 1))
        self._each = [Convolution(kernel) for kernel in kernels]
        self._spectra: Callable[[int], Spectrum] = lru_cache(CACHED)(partial(fft.rfft, kernels))

    def at_rest(self) -> Array:
        """State before sample 0."""
        return self._before

    def invert(self, state: Array, blocks: Sequence[Array]) -> tuple[Array, list[Array]]:
        """Inputs of each axis for the targets whose preview is complete with its block."""
        begin, lost = state.shape[1], self._each[0].taps - 1
        length = begin + len(blocks[0])
        rows = np.zeros((len(blocks), _fast(max(length, 1))))
        rows[:, :begin] = state
        for row, block in zip(rows, blocks, strict=True):
            row[begin:length] = block
        after = rows[:, max(length - lost, 0) : length].copy()
        if rows.shape[1] > SAMPLES:
            return after, [e.valid(row[:length]) for e, row in zip(self._each, rows, strict=True)]
        return after, list(_cyclic(rows, self._spectra(rows.shape[1]))[:, lost:length])

    def finish(self, state: Array) -> list[Array]:
        """Inputs still owed, each axis' last target being held."""
        held = [np.full(self.preview, row[-1] if len(row) else 0.0) for row in state]
        return self.invert(state, held)[1]
