"""A prediction beyond the drive that a model was identified in, and its standard deviation.

Beyond, branches go on with the slopes that they have at the ends of the range. How much
displacement that adds is unknown by as much as these slopes differ from the mean one. The rest of
the error follows from the parameters, and from the model's error on its records.
"""

import math
from functools import partial

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.discrepancy import detection_limit
from afm_scan_ros.core.effects.hysteresis.duhem import DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.scale import resonance_of
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.intersample import HELD, held_voltages, moved_by, voltages_of
from afm_scan_ros.core.model import AxisModel, HysteresisOperator, ScannerModel, effect_of
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import forward
from afm_scan_ros.core.spread import Spread, Variant
from afm_scan_ros.core.types import AXES, Array, Trace, setting


@frozen
class ExtensionSettings:
    """How far predictions go."""

    share: float = setting(
        0.1,
        "1",
        "share by which the voltages at the ends of the range may be exceeded",
        "branches bend little over a tenth of the range",
    )


SHARE = ExtensionSettings().share


def extended(model: ScannerModel, drive: Trace, share: float = SHARE) -> ScannerModel:
    """Return the model, wider by a share for axes whose drive (V) leaves the identified range."""
    axes = {n: extended_axis(model.axis(n), getattr(drive, n), share) for n in model.axes}
    return evolve(model, **axes)


def extended_axis(model: AxisModel, drive: Array, share: float = SHARE) -> AxisModel:
    """Return the same of one axis, whose drive (V) is of shape (n,)."""
    forward = model.hysteresis.forward
    lower, upper = forward.drive_range
    lowest, highest = _farther(lower, upper, share)
    if _within(drive, lower, upper) or not _within(drive, lowest, highest):
        return model
    return evolve(model, hysteresis=evolve(model.hysteresis, forward=_wider(forward, share)))


def with_overshoot(model: ScannerModel, record: Record) -> ScannerModel:
    """Return a model that holds what a record's band-limited drive overshoots between samples."""
    if record.intersample == HELD:
        return model
    return extended(model, voltages_of(record.traces()[0], record.intersample))


def _farther(lower: float, upper: float, share: float) -> tuple[float, float]:
    """Return voltages (V) of which those away from 0 V are exceeded by a share."""
    grown = 1.0 + share
    return min(lower, grown * lower), max(upper, grown * upper)


def _within(drive: Array, lower: float, upper: float) -> bool:
    return bool(np.all((drive >= lower) & (drive <= upper)))


def unknown_beyond(model: AxisModel, drive: Array, share: float = SHARE) -> Array:
    """How far a slow prediction (m), (n,), is from a straight line where it is beyond the range."""
    forward = model.hysteresis.forward
    inside = np.clip(drive, *forward.drive_range)
    if np.array_equal(inside, drive):
        return np.zeros(len(drive))
    effects = effect_of(_wider(forward, share)), effect_of(forward)
    within, at_ends = (
        effect.apply(effect.at_rest(), at)[1]
        for effect, at in zip(effects, (drive, inside), strict=True)
    )
    bent = within - at_ends - forward.chord * (drive - inside)
    return np.asarray(np.abs(model.vibration.static_gain * bent))


def _wider(operator: HysteresisOperator, share: float) -> HysteresisOperator:
    if isinstance(operator, DuhemSlopes):
        return _slopes(operator, share)
    return _surface(operator, share)


def _surface(surface: EverettSurface, share: float) -> EverettSurface:
    """Add levels beyond both ends, up to which E goes on straight; the output at rest stays."""
    grown = 1.0 + share
    levels, values = surface.levels, np.tril(surface.values)
    if surface.upper > 0.0:
        levels, values = _with_level(levels, values, grown * surface.upper)
    if surface.lower < 0.0:
        # Where the signs of alpha and beta change, and so their places, E is the same.
        turned = _with_level(-levels[::-1], values[::-1, ::-1].T, -grown * surface.lower)
        levels, values = -turned[0][::-1], turned[1][::-1, ::-1].T
    bias = None if surface.bias is None else grown**2 * surface.bias
    within = None if surface.within is None else _farther(*surface.within, share)
    wider = EverettSurface(levels[0], levels[-1], values, surface.offset, bias, levels, within)
    rests = [Preisach(one).at_rest().now[1] for one in (surface, wider)]
    return evolve(wider, offset=surface.offset + rests[0] - rests[1])


def _with_level(levels: Array, values: Array, upper: float) -> tuple[Array, Array]:
    """Add a level above the others, with E at its slope over alpha below the last of them."""
    rises = values[-1] - np.append(values[-2, :-1], 0.0)
    rises[-1] = values[-1, -2]
    last = values[-1] + (upper - levels[-1]) / (levels[-1] - levels[-2]) * rises
    return np.append(levels, upper), np.vstack([np.pad(values, ((0, 0), (0, 1))), [*last, 0.0]])


def _slopes(slopes: DuhemSlopes, share: float) -> DuhemSlopes:
    """Add as many cells beyond either end as are needed, of the slopes on the edge."""
    _, cell, *_ = slopes.grid
    count = math.ceil(share * max(map(abs, slopes.drive_range)) / cell)
    more = (count, count), (0, 0)
    rising, falling = (np.pad(each, more, mode="edge") for each in (slopes.rising, slopes.falling))
    centre = np.pad(slopes.centre, count, mode="edge")
    ends = slopes.lower - count * cell, slopes.upper + count * cell
    wider = DuhemSlopes(*ends, 0.0, slopes.rest, slopes.widths, centre, rising, falling)
    return evolve(wider, offset=slopes.offset - wider.height(slopes.lower))


def standard_deviation(
    model: ScannerModel, drive: Trace, moved: Trace, share: float = SHARE, intersample: str = HELD
) -> Trace:
    """Standard deviation (m) of a motion predicted for a drive (V), without the sensor's noise.

    Without a ``Spread`` it is the rms error of the motion. InputError where an axis has none.
    """
    found, period = {name: np.zeros_like(moved.x) for name in AXES}, drive.sample_period
    for name in model.axes:
        axis, volts, motion = model.axis(name), drive.axis(name), moved.axis(name)
        beyond = unknown_beyond(axis, volts, share)
        if axis.spread is None:
            found[name] = np.hypot(_of_records(axis, name, motion, period), beyond)
            continue
        known = np.sum(apart(axis, axis.spread, volts, period, share, intersample) ** 2, axis=0)
        left = discrepancy(axis.spread, motion, period)
        found[name] = np.sqrt(known + left**2 + beyond**2)
    return evolve(moved, x=found["x"], y=found["y"])


def apart(
    axis: AxisModel,
    spread: Spread,
    drive: Array,
    sample_period: float,
    share: float = SHARE,
    intersample: str = HELD,
) -> Array:
    """What a standard deviation in each direction adds to a prediction (m), (directions, n).

    Effects that were added to the axis are left out. About the mean, where the rest is not known.
    """
    volts = held_voltages(drive, intersample)

    def moved(variant: Variant) -> Array:
        wider = extended_axis(varied(axis, variant), volts, share)
        return moved_by(partial(forward, wider), drive, sample_period, intersample)

    middle = moved(spread.centre)
    each = np.array([(moved(one) - middle) / one.deviations for one in spread.directions])
    each = each.reshape(-1, len(drive))
    return each if spread.rest_known else each - each.mean(axis=1, keepdims=True)


def discrepancy(spread: Spread, moved: Array, sample_period: float) -> float:
    """Rms error (m) of a predicted motion (m), (n,), beyond what its parameters explain."""
    return float(np.linalg.norm(spread.shares * rms_by_band(moved, spread.bands, sample_period)))


def varied(axis: AxisModel, variant: Variant) -> AxisModel:
    """Return an axis with the effects of a variant, and without any that was added to it."""
    return evolve(
        axis,
        hysteresis=evolve(axis.hysteresis, forward=variant.forward, output=variant.output),
        vibration=variant.vibration,
        creep=variant.creep,
        sensor=variant.sensor,
        added=(),
    )


def _of_records(axis: AxisModel, name: str, moved: Array, sample_period: float) -> float:
    """Rms error (m) of a motion by that on the model's records."""
    if not axis.model_discrepancies:
        raise InputError(
            f"the model of axis {name} states no error, so none of a prediction: identify it anew,"
            " with a validation record"
        )
    resonance = resonance_of(axis.vibration, sample_period)
    limit = detection_limit(axis.model_discrepancies, moved, sample_period, resonance)
    return float(np.sqrt(np.sum(np.maximum(limit.rms**2 - limit.noise**2, 0.0))))
