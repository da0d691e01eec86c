"""What an image shows beside the surface: noise, offsets of lines, scars, spikes, whole steps."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array


@frozen
class Detection:
    """Errors of the heights read, in m but for chances, which have no unit, and ``bow`` (1/m).

    ``noise`` is white, ``offset`` is the rms of what each line is shifted by. A line is a scar from
    some pixel on with the chance ``scars``, of ``scar`` rms. A pixel is a spike with the chance
    ``spikes``, of ``spike`` rms. ``quantum`` is one step of the converter. ``bow`` times the
    squared distance from the middle is what the scanner's z adds.
    """

    noise: float = 0.0
    offset: float = 0.0
    scars: float = 0.0
    scar: float = 0.0
    spikes: float = 0.0
    spike: float = 0.0
    quantum: float = 0.0
    bow: float = 0.0


def detected(heights: Array, detection: Detection, rng: np.random.Generator) -> Array:
    """Heights (m) as an image holds them, (lines, pixels)."""
    lines, pixels = heights.shape
    shown = heights + detection.noise * rng.standard_normal(heights.shape)
    shown += detection.offset * rng.standard_normal((lines, 1))
    scarred = rng.random((lines, 1)) < detection.scars
    after = np.arange(pixels) >= rng.integers(0, pixels, (lines, 1))
    shown += scarred * after * detection.scar * rng.standard_normal((lines, 1))
    spiked = rng.random(heights.shape) < detection.spikes
    shown += spiked * detection.spike * rng.standard_normal(heights.shape)
    if detection.quantum > 0.0:
        shown = detection.quantum * np.rint(shown / detection.quantum)
    return np.asarray(shown)


def drawn_detection(rng: np.random.Generator, depth: float, reach: float) -> Detection:
    """Draw errors for features of a ``depth`` (m) in an image of ``reach`` (m) to each side."""
    return Detection(
        noise=float(depth * 0.003 * 20.0 ** rng.random()),
        offset=float(depth * 0.003 * 30.0 ** rng.random()),
        scars=float(rng.uniform(0.0, 0.03)),
        scar=float(depth * rng.uniform(0.1, 0.6)),
        spikes=float(rng.uniform(0.0, 3e-4)),
        spike=float(depth * rng.uniform(0.5, 3.0)),
        quantum=float(depth / rng.integers(100, 2000)),
        bow=float(rng.uniform(-2.0, 2.0) * depth / reach**2),
    )
