"""How far a scanner may be from the model of its fit: by parameters, and by what it misses.

The discrepancy of a record k is a share η_k of its motion m_k. Of a record that was held out it is
what the model misses beyond the sensor's noise n_k and beyond what its parameters explain,

    (η_k m_k)² = e_k² - n_k² - Σ_i var((y_i - y_c) / d_i),

and of one that was fitted what the fit leaves beyond noise. In each band η² is the mean of the
records held out that move there, or else of those fitted, or else the largest. Added are the
squares of ``least_discrepancy`` and of what the model loses of the fit's own scans from rest, but
for their mean.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import places_moved
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.fit.directions import lost_by
from afm_scan_ros.core.fit.signals import noise_of
from afm_scan_ros.core.fit.told import Knowledge
from afm_scan_ros.core.identification.validation import Validation
from afm_scan_ros.core.model import AxisModel, band_edges
from afm_scan_ros.core.prediction import apart
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import Array


@frozen(eq=False)
class HeldOut:
    """A ``record`` of one axis that was held out, and what the model leaves of it.

    It counts from sample ``first`` on, as its memory is known there.
    """

    record: Record
    first: int
    validation: Validation


@frozen(eq=False)
class MissedMotion:
    """Rms motion (m) of a record in each band, (bands,), and the squared share that is missed."""

    moved: Array
    squared: float


def spread_of(known: Knowledge, model: AxisModel, held_out: Sequence[HeldOut]) -> Spread:
    """Return how far the scanner may be from the model of its fit."""
    period = known.fit.shortest
    bands = band_edges(period, resonance_of(model.vibration, period))
    rest_known = any(one.rested for one in known.fit.records)
    spread = Spread(*known.variants(), bands, np.zeros(len(bands) - 1), rest_known)
    least = known.fit.layout.settings.least_discrepancy
    fitted = _fitted(known, bands)
    shares = _by_band(fitted, np.full(len(bands) - 1, max(one.squared for one in fitted)))
    shares = _by_band([_left_out(model, spread, one) for one in held_out], shares)
    return evolve(spread, shares=np.sqrt(least**2 + lost_by(model, known.fit) + shares))


def _fitted(known: Knowledge, bands: Sequence[float]) -> list[MissedMotion]:
    """What the fit leaves of its records beyond noise."""
    found = []
    for one, left in zip(known.fit.records, known.fit.residuals(), strict=True):
        beyond = max(float(np.mean(left**2)) - one.noise**2 / one.block, 0.0)
        moved = rms_by_band(one.displacement, bands, one.period)
        found.append(MissedMotion(moved, beyond / one.motion**2))
    return found


def _left_out(model: AxisModel, spread: Spread, one: HeldOut) -> MissedMotion:
    """What the model leaves of a record beyond noise and beyond what its parameters explain."""
    period, part = one.record.sample_period, slice(one.first, None)
    drive, displacement = one.record.signals(one.record.axes[0])
    each = apart(model, spread, drive, period, intersample=one.record.intersample)
    explained = np.var(each[:, part], axis=1).sum()
    left = one.validation.residual  # from there on
    error = float(np.var(left)) - noise_of(left) ** 2
    moved = rms_by_band(displacement[part], spread.bands, period)
    return MissedMotion(
        moved, max(error - float(explained), 0.0) / float(np.var(displacement[part]))
    )


def _by_band(records: Sequence[MissedMotion], otherwise: Array) -> Array:
    """Mean squared share (bands,) of the records that move in a band, or what it is otherwise."""
    moving = np.zeros((len(records), len(otherwise)))
    for row, one in zip(moving, records, strict=True):
        row[places_moved(one.moved)] = 1.0
    count = moving.sum(axis=0)
    total = np.array([one.squared for one in records]) @ moving
    return np.where(count > 0.0, total / np.maximum(count, 1.0), otherwise)
