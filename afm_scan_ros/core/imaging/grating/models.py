"""The motion seen in an image of a grating → models of x and y.

x repeats its line, so the drive and the mean line are a record of a loop, in which what lies beyond
the image was not measured. One line rate cannot separate hysteresis from a lag and from creep: all
of what differs between trace and retrace is fitted as hysteresis. y moves once, one way: its creep,
its drift and its hysteresis look alike, so it has a gain alone.
"""

from collections.abc import Sequence

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.joint.axis import hysteresis_of
from afm_scan_ros.core.identification.joint.fit import fit_jointly
from afm_scan_ros.core.identification.joint.moving import MovingRecord
from afm_scan_ros.core.identification.joint.search import LAGS, NO_CREEP
from afm_scan_ros.core.identification.statuses import unknown
from afm_scan_ros.core.imaging.grating.motion import middles
from afm_scan_ros.core.imaging.grating.registration import Registration
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.core.model import (
    AxisModel,
    BaseEffects,
    EffectStatus,
    HysteresisModel,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.core.types import Array, ProgressCallback

PERIODS = 3
"""To-and-fro lines of a record: the first one writes the memory of the next."""
LEVELS = 3
"""Levels of a surface that is a straight line."""


@frozen(eq=False)
class Positions:
    """Where the tip was over the grating at each pixel, m, zero on average: (lines, pixels, 2).

    x runs along the mean direction of the lines, y at a right angle to it. ``retrace`` is None
    where there is none. ``uncertainty`` (lines, pixels), m, is the trace's standard deviation.
    """

    trace: Array
    retrace: Array | None
    uncertainty: Array


def positions_of(registration: Registration, directions: int) -> Positions:
    """Turn the motion in cells of one direction or both into x and y in m."""
    cells = [registration.image(direction) for direction in range(directions)]
    along = np.sum([each[:, -1] - each[:, 0] for each in cells], axis=0).mean(axis=0)
    cosine, sine = along / np.hypot(*along)
    turn = registration.pitch * np.array([[cosine, -sine], [sine, cosine]])
    middle = np.mean([each.mean(axis=(0, 1)) for each in cells], axis=0)
    found = [(each - middle) @ turn for each in cells]
    uncertainty = registration.pitch * registration.uncertainty(0)
    return Positions(found[0], found[1] if directions > 1 else None, uncertainty)


def model_of(
    images: Sequence[ScanImage],
    positions: Sequence[Positions],
    volts_per_metre: tuple[float, float],
    progress: ProgressCallback,
) -> ScannerModel:
    """Identify x from the positions in all images, and y from those in the largest.

    Drives are ``volts_per_metre`` (V/m) times the commanded positions, zero in the image's middle.
    Raises InputError without a retrace, which shows the hysteresis, or where the time of a line is
    not known; ScanError where the fit does not converge.
    """
    records = [
        _record(image, each, volts_per_metre[0])
        for image, each in zip(images, positions, strict=True)
    ]
    x = _with_hysteresis(records, progress)
    pairs = zip(images, positions, strict=True)
    largest, found = max(pairs, key=lambda pair: pair[0].range_y)
    shortest = min(record.sample_period for record in records)
    return ScannerModel(x, _with_gain(largest, found.trace, volts_per_metre[1], shortest))


def lines_of(
    image: ScanImage, scale: float, line_time: float
) -> tuple[Array, NDArray[np.bool_], float]:
    """Drive (V) of some to-and-fro lines, which samples of one line are imaged, and the period (s).

    In each direction as many samples are imaged as a line has pixels, each in a pixel's middle.
    """
    beyond = round(image.pixels * image.overscan)
    half = image.pixels + 2 * beyond
    place = middles(half) * half / image.pixels  # of half the image's range
    drive = 0.5 * image.range_x * scale * np.concatenate([place, place[::-1]])
    imaged = np.zeros(half, dtype=bool)
    imaged[beyond : half - beyond] = True
    return np.tile(drive, PERIODS), np.tile(imaged, 2), line_time / (2 * half)


def rows_of(image: ScanImage, scale: float) -> Array:
    """Drive (V) of y in each line, from the lowest to the highest: (lines,)."""
    return np.asarray(0.5 * image.range_y * scale * middles(image.lines))


def _record(image: ScanImage, positions: Positions, scale: float) -> MovingRecord:
    """Return the mean to-and-fro line of an image, several times."""
    if positions.retrace is None or image.line_time is None:
        raise InputError(
            f"{image.name}: a model needs trace, retrace and the time of a line: give an image"
            " that holds them, or the time"
        )
    drive, imaged, period = lines_of(image, scale, image.line_time)
    there, back = (each[..., 0].mean(axis=0) for each in (positions.trace, positions.retrace))
    line = np.zeros(len(imaged))
    line[imaged] = np.concatenate([there, back[::-1]])
    moved, measured = np.tile(line, PERIODS), np.tile(imaged, PERIODS)
    return MovingRecord(f"x of {image.name}", drive, moved, period, measured=measured)


def _with_hysteresis(records: Sequence[MovingRecord], progress: ProgressCallback) -> AxisModel:
    shortest = min(record.sample_period for record in records)
    joint = fit_jointly(records, _at_once(1.0, shortest), NO_CREEP, progress)
    hysteresis, vibration = hysteresis_of(joint, None)
    drive = joint.grid.lower, joint.grid.upper
    known = EffectStatus(drive=drive, frequencies=(0.0, max(one.swings for one in records)))
    effects = BaseEffects(unknown("creep"), known, unknown("frequency"))
    return AxisModel(hysteresis, vibration, NO_CREEP, effects=effects)


def _with_gain(image: ScanImage, trace: Array, scale: float, period: float) -> AxisModel:
    """Return the straight line that fits y best, line by line.

    Like x it follows within a sample of a ``period`` (s): a scan steps it at any rate.
    """
    drive = rows_of(image, scale)
    gain = float(np.polynomial.polynomial.polyfit(drive, trace[..., 1].mean(axis=1), 1)[1])
    reach = 0.5 * image.range_y * scale
    levels = np.linspace(-reach, reach, LEVELS)
    line = EverettSurface(-reach, reach, np.tril(0.5 * (levels[:, np.newaxis] - levels)), -reach)
    effects = BaseEffects(unknown("creep"), unknown("hysteresis"), unknown("frequency"))
    return AxisModel(HysteresisModel(line, line), _at_once(gain, period), NO_CREEP, effects=effects)


def _at_once(gain: float, period: float) -> VibrationModel:
    """Vibration of a gain (m/V) that is too fast for samples of a ``period`` (s) to show."""
    return VibrationModel((gain,), (float(LAGS[0]) * period, 1.0))
