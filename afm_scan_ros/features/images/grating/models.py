"""The motion seen in an image of a grating → models of x and y.

x repeats its line, so the drive and the mean line are a record of a loop, in which what lies beyond
the image was not measured. Two forms of hysteresis compete for it, by how well they predict parts
of the loop from the others: the smoothest density of Preisach's, and Bouc's and Wen's model, whose
few numbers one loop determines. One line rate cannot separate hysteresis from a lag and from creep:
all of what differs between trace and retrace is fitted as hysteresis. Several line rates can: a lag
or a resonance, and creep, are sought in the same fit. y moves once, one way: its creep and its
hysteresis look alike, so it has a gain alone, which images of both directions free of drift. What
each axis adds to the other shows as an angle of y, that of the fastest image.
"""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.fit.surfaces import direct_of, from_rest
from afm_scan_ros.core.fit.told import unknown
from afm_scan_ros.core.model import (
    Added,
    AxisModel,
    BaseEffects,
    EffectStatus,
    HysteresisModel,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.core.types import Array, ProgressCallback
from afm_scan_ros.features.images.grating.registration import Registration
from afm_scan_ros.features.images.loops.bouc_wen import fit_bouc_wen
from afm_scan_ros.features.images.loops.density import surface_of
from afm_scan_ros.features.images.loops.fit import (
    COARSE,
    JointFit,
    fit_jointly,
    grid_of,
    held_out_by_density,
)
from afm_scan_ros.features.images.loops.moving import MovingRecord, swept
from afm_scan_ros.features.images.loops.search import NO_CREEP, at_once
from afm_scan_ros.features.images.positions import LineDrive, rows_of
from afm_scan_ros.features.images.scan_image import ScanImage, line_time_of

APART = 2.0
"""Ratio of line rates from which on they show what depends on the rate."""
WELL = 0.5
"""Information of a line over the mean line's, from which on edges show y."""
LEVELS = 3
"""Levels of a surface that is a straight line."""


@frozen(eq=False)
class Positions:
    """Where the tip was over the grating at each pixel, m, zero on average: (lines, pixels, 2).

    x runs along the mean direction of the lines, y at a right angle to it. ``uncertainty`` (lines,
    pixels), m, is the trace's standard deviation. It is infinite in the line scanned first, which
    begins at rest and moves otherwise, and in those before the first edges that show y: y turned
    just before, so no later motion tells theirs.
    """

    trace: Array
    retrace: Array
    uncertainty: Array

    @property
    def known(self) -> slice:
        """Lines that are known: all but those scanned first."""
        lines = np.flatnonzero(np.isfinite(self.uncertainty[:, 0]))
        return slice(int(lines[0]), int(lines[-1]) + 1)


def positions_of(registration: Registration, *, upward: bool = True) -> Positions:
    """Turn the motion in cells into x and y in m."""
    form = registration.form
    cells = [form.image(direction, registration.coefficients) for direction in range(2)]
    along = np.sum([each[:, -1] - each[:, 0] for each in cells], axis=0).mean(axis=0)
    cosine, sine = along / np.hypot(*along)
    turn = registration.pitch * np.array([[cosine, -sine], [sine, cosine]])
    middle = np.mean([each.mean(axis=(0, 1)) for each in cells], axis=0)
    found = [(each - middle) @ turn for each in cells]
    uncertainty = registration.pitch * form.deviation(0, registration.covariance)
    shown = np.einsum("lij,i,j->l", registration.shown, turn[:, 1], turn[:, 1])
    uncertainty[_before_edges(shown, upward=upward)] = np.inf
    return Positions(found[0], found[1], uncertainty)


def _before_edges(shown: Array, *, upward: bool) -> slice:
    """Lines before the first that shows y well, by the information of each; one at least."""
    in_time = shown if upward else shown[::-1]
    count = max(1, int(np.argmax(in_time >= WELL * in_time.mean())))
    return slice(0, count) if upward else slice(len(shown) - count, None)


def model_of(
    images: Sequence[ScanImage],
    positions: Sequence[Positions],
    volts_per_metre: tuple[float, float],
    progress: ProgressCallback,
) -> ScannerModel:
    """Identify x from the positions in all images, and y from those in the largest ones.

    Drives are ``volts_per_metre`` (V/m) times the commanded positions, zero in the image's middle.
    Raises InputError where the time of a line is not known; ScanError where the fit does not
    converge.
    """
    records = [
        _record(image, each, volts_per_metre[0])
        for image, each in zip(images, positions, strict=True)
    ]
    rates = [1.0 / image.line_time for image in images if image.line_time]
    x = _with_hysteresis(records, (min(rates), max(rates)), progress)
    shortest = min(record.sample_period for record in records)
    gain = _gain_of_y(images, positions, volts_per_metre[1])
    reach = max(0.5 * image.range_y * volts_per_metre[1] for image in images)
    y, added = _with_gain(gain, reach, shortest), _coupling(images, positions)
    return ScannerModel(evolve(x, added=added), evolve(y, added=added))


def _record(image: ScanImage, positions: Positions, scale: float) -> MovingRecord:
    """Return the mean to-and-fro line of an image, several times."""
    line = LineDrive.of(image, scale, line_time_of(image))
    there, back = (each[..., 0].mean(axis=0) for each in (positions.trace, positions.retrace))
    moved = line.moved(there, back)
    name = f"x of {image.name}"
    return MovingRecord(name, line.drive, moved, line.sample_period, measured=line.imaged())


def _with_hysteresis(
    records: Sequence[MovingRecord], rates: tuple[float, float], progress: ProgressCallback
) -> AxisModel:
    """Identify x, and what follows its hysteresis where the line ``rates`` (Hz) differ."""
    slowest, fastest = rates
    joint = fit_jointly(records, progress, at_rates=fastest >= APART * slowest)
    hysteresis, vibration = _of_better_form(records, joint)
    drive = joint.grid.lower, joint.grid.upper
    known = EffectStatus(drive=drive, frequencies=rates)
    creep, rings = unknown("creep"), unknown("frequency")
    if joint.creep is not None:
        holds = 0.5 / fastest, 0.5 / slowest
        creep = EffectStatus(drive=drive, hold_times=holds, intervals=joint.creep)
    if joint.vibration is not None:
        rings = evolve(known, intervals=joint.vibration)
    effects = BaseEffects(creep, known, rings)
    return AxisModel(hysteresis, vibration, joint.dynamics.creep, effects=effects)


def _of_better_form(
    records: Sequence[MovingRecord], joint: JointFit
) -> tuple[HysteresisModel, VibrationModel]:
    """Hysteresis of the form that predicts parts of the loops better; no loop has a density."""
    hysteresis, vibration = _of_density(joint)
    grid = grid_of(records, COARSE)
    rows = list(swept(records, grid))
    found = fit_bouc_wen(rows, joint.dynamics, grid.lower, grid.upper)
    if found.held_out >= held_out_by_density(rows, joint.dynamics, joint.smoothing):
        return hysteresis, vibration
    try:
        slopes = found.slopes()
    except InputError:  # there is no loop
        return hysteresis, vibration
    numerator = tuple(found.gain * each for each in joint.dynamics.vibration.numerator)
    return evolve(hysteresis, forward=slopes), evolve(vibration, numerator=numerator)


def _of_density(joint: JointFit) -> tuple[HysteresisModel, VibrationModel]:
    """Fix the gauge: F is 0 at rest, and runs over as many volts as the drive."""
    gain = 2.0 * float(joint.weights.sum()) / joint.grid.width
    surface = surface_of(joint.weights, joint.grid, 0.0)
    forward, _ = from_rest(evolve(surface, values=surface.values / gain), None)
    vibration = joint.dynamics.vibration
    numerator = tuple(gain * each for each in vibration.numerator)
    direct = direct_of(forward, None, DEFAULT_SETTINGS.direct_levels)
    return HysteresisModel(forward, direct), evolve(vibration, numerator=numerator)


def _gain_of_y(images: Sequence[ScanImage], positions: Sequence[Positions], scale: float) -> float:
    """Slope (m/V) of y, line by line, of the largest image, or of those of both directions."""
    largest = max(images, key=lambda image: image.range_y)
    slopes: dict[bool, float] = {}
    for image, found in zip(images, positions, strict=True):
        if image.range_y == largest.range_y:
            drive, moved = rows_of(image, scale), found.trace[..., 1].mean(axis=1)
            known = drive[found.known], moved[found.known]
            slopes[image.upward] = float(np.polynomial.polynomial.polyfit(*known, 1)[1])
    return float(np.mean(list(slopes.values())))


def _coupling(images: Sequence[ScanImage], positions: Sequence[Positions]) -> tuple[Added, ...]:
    """What each axis has of the other, where the angle of y is no drift: half the angle each.

    In the fastest images the sample drifts least; none is seen where all have one line rate. No
    image shows how it is turned, so only the sum of both shares is seen. Equal ones turn the scan
    least.
    """
    times = [image.line_time or np.inf for image in images]
    if max(times) < APART * min(times):
        return ()
    angles = []
    for image, found in zip(images, positions, strict=True):
        if image.line_time == min(times):
            x, y = found.trace[found.known].mean(axis=1).T
            angles.append(float(np.polynomial.polynomial.polyfit(y, x, 1)[1]))
    return (Added("cross_coupling", "static", (0.5 * float(np.mean(angles)),)),)


def _with_gain(gain: float, reach: float, period: float) -> AxisModel:
    """Return a straight line of a gain (m/V), to drives of ``reach`` (V) either way.

    Like x it follows within a sample of a ``period`` (s): a scan steps it at any rate.
    """
    levels = np.linspace(-reach, reach, LEVELS)
    line = EverettSurface(-reach, reach, np.tril(0.5 * (levels[:, np.newaxis] - levels)), -reach)
    effects = BaseEffects(unknown("creep"), unknown("hysteresis"), unknown("frequency"))
    return AxisModel(HysteresisModel(line, line), at_once(gain, period), NO_CREEP, effects=effects)
