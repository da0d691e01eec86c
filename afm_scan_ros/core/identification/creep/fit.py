"""A creep record → the springs and dampers in series of Eq. 1 (Croft, Shed & Devasia 2001).

While the drive rests after a step, so does the hysteresis' output F: the step's height in F is
unknown, its shape is not. The record therefore shows creep alone, whatever the hysteresis is.
"""

from collections.abc import Mapping

from attrs import frozen

from afm_scan_ros.core.identification.creep.checks import (
    element_findings,
    record_findings,
    refuse_implausible,
)
from afm_scan_ros.core.identification.creep.order import (
    Interval,
    OrderTried,
    choose,
    intervals,
    try_orders,
)
from afm_scan_ros.core.identification.creep.record import creep_record
from afm_scan_ros.core.identification.creep.series import refine
from afm_scan_ros.core.identification.findings import Finding
from afm_scan_ros.core.identification.records.recording import Misfit, misfit
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.types import Array

HIGHEST = 6
"""Largest order that is tried."""


@frozen
class CreepFit:
    """The creep of one axis, and how well it is known."""

    model: CreepModel
    """The chosen order fitted to the whole record, its elements from the fastest."""
    order: int
    """Chosen by ``order.choose``."""
    orders: tuple[OrderTried, ...]
    """Each order tried, fitted without what is held out."""
    fitted: Misfit
    """Error of ``model`` on the whole record, m, sample by sample (Eqs. 2, 3)."""
    held_out: Misfit
    """Error of the chosen order, fitted without it, on the part held out, m."""
    noise: float
    """Noise of the record, rms, m: what varies from each sample to the next."""
    intervals: Mapping[str, Interval]
    """95 % interval of ``gain_1``, ``time_constant_1`` (s), …; an open one ends at 0 or inf."""
    warnings: tuple[Finding, ...]
    """What this record does not determine."""


def fit_creep(
    drive: Array, displacement: Array, sample_period: float, highest: int = HIGHEST
) -> CreepFit:
    """Fit Eq. 1, as 1 + Σ g_i/(1 + s τ_i), to one axis: drive (V) and displacement (m), both (n,).

    The order is chosen on the last hold, of which only the step's height is estimated, or where
    there is one hold alone, on its last quarter. The intervals take the noise for white. Raises
    InputError unless the drive rests, steps and holds still long enough.
    """
    record = creep_record(drive, displacement, sample_period)
    tried = try_orders(record, highest)
    chosen = choose(tried)
    averaged = record.averaged()
    series = refine(averaged, chosen.series)
    model = CreepModel(series.gains, series.time_constants)
    fitted = misfit(record.displacement - series.predict(record))
    refuse_implausible(model, record, fitted)
    found = intervals(averaged, series)
    return CreepFit(
        model=model,
        order=chosen.order,
        orders=tried,
        fitted=fitted,
        held_out=chosen.held_out,
        noise=record.noise,
        intervals=found,
        warnings=(
            *element_findings(model, found, record.longest),
            *record_findings(model, record, chosen.held_out),
        ),
    )
