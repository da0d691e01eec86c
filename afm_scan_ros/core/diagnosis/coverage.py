"""Whether a model's error is known for the motion of a record: for its size and for its rates.

A model's error on one kind of motion says little of another kind. Effects of the rate grow with the
rate, and the relative error of hysteresis grows as loops shrink. Larger motion is bounded by the
range that the model was identified in.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import ALIKE, moves_alike, places_moved
from afm_scan_ros.core.model_discrepancy import ModelDiscrepancy, band_edges
from afm_scan_ros.core.types import Array


@frozen
class Motion:
    """Motion of ``size`` (m rms) in the bands from ``low`` to ``high`` (Hz)."""

    size: float
    low: float
    high: float

    @classmethod
    def of(cls, edges: Sequence[float] | Array, moved: Array) -> "Motion":
        """Return the motion of ``moved`` (bands,) in m rms between ``edges`` (Hz)."""
        places = places_moved(moved)
        return cls(
            float(np.linalg.norm(moved)), float(edges[places[0]]), float(edges[places[-1] + 1])
        )


def tested_motion(known: Sequence[ModelDiscrepancy]) -> Motion | None:
    """Smallest motion, and all rates, at which the error is known; None where at none.

    Motion that was fitted does not count.
    """
    sizes = [(one.bands, np.array(one.displacement)) for one in known if not one.fitted]
    motions = [Motion.of(bands, moved) for bands, moved in sizes if moved.any()]
    if not motions:
        return None
    smallest = min(one.size for one in motions)
    return Motion(smallest, min(one.low for one in motions), max(one.high for one in motions))


def untested_motion(
    known: Sequence[ModelDiscrepancy], displacement: Array, sample_period: float, resonance: float
) -> Motion | None:
    """Motion of a ``displacement`` (n,) in m, if a model of ``known`` errors was tested at none.

    None where a record of the same kind is known, or others as small and at such rates.
    """
    edges = np.array(band_edges(sample_period, resonance))
    moved = rms_by_band(displacement, edges, sample_period)
    if moves_alike(known, edges, moved):
        return None
    motion, tested = Motion.of(edges, moved), tested_motion(known)
    within = tested and (
        motion.size * ALIKE >= tested.size
        and motion.low >= tested.low
        and motion.high <= tested.high
    )
    return None if within else motion
