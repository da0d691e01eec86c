"""A hysteresis record → its first-order reversal curves, and its held-out loops.

A falling curve turns where the drive has risen from negative saturation, and returns there; a
rising one turns where it has fallen from positive saturation. Turning points are read from the
recorded drive, so that a record made elsewhere serves too.

The drive of held-out loops is predicted from the effective input, as a scan's is. Errors last from
one turn of the drive to the next, so that samples add little to the branches between turns. One
inverse counts as better than a simpler one where Student's paired test of the branches' mean
squares says so, one-sided, at SIGNIFICANT.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray
from scipy.stats import ttest_rel

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, Preisach
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import HysteresisModel, effect_of
from afm_scan_ros.core.types import Array

Samples: TypeAlias = NDArray[np.int64]

ON_SATURATION = 1e-3
"""Share of the drive's range by which a curve may miss saturation."""
WIDEST_GAP = 2.5
"""Distance of neighbouring turning points, over that about them, beyond which curves are missing.

Where one is left out the distance is twice the others', and the smooth surface goes on between.
"""
ABOUT = 2
"""Distances to either side that are looked at for it."""
TURNS = 3
"""Levels at which reversal curves turn, at least: a sine of one amplitude has two."""


@frozen(eq=False)
class ReversalCurve:
    """A first-order reversal curve from its turning point on: inputs and outputs, both (n,).

    ``turn`` is the input where it leaves the major loop.
    """

    inputs: Array
    outputs: Array
    turn: float = field()

    @turn.default
    def _first(self) -> float:
        return float(self.inputs[0])

    @property
    def rises(self) -> bool:
        """Whether it rises, having turned on the falling branch of the major loop."""
        return bool(self.inputs[-1] > self.inputs[0])

    def exchanged(self) -> "ReversalCurve":
        """Return the same curve as the inverse sees it."""
        return ReversalCurve(self.outputs, self.inputs)

    def within(self, lower: float, upper: float) -> "ReversalCurve":
        """Return the points whose inputs lie within the limits."""
        inside = (self.inputs >= lower) & (self.inputs <= upper)
        return ReversalCurve(self.inputs[inside], self.outputs[inside], self.turn)

    def thinned(self, places: Callable[[Array], Array]) -> "ReversalCurve":
        """Return the averages over stretches, empty ones left out; one is 1 long in ``places``.

        The last stretch, seldom whole, goes with the one before it.
        """
        way = places(self.inputs) - places(np.array([self.turn]))
        stretch = np.abs(way).astype(np.int64)
        stretch = np.minimum(stretch, max(stretch.max() - 1, 0))
        count = np.bincount(stretch)
        held = count > 0
        inputs, outputs = (
            np.bincount(stretch, values)[held] / count[held]
            for values in (self.inputs, self.outputs)
        )
        return ReversalCurve(inputs, outputs, self.turn)


@frozen(eq=False)
class ReversalCurves:
    """Where the curves lie in a record.

    ``falling`` and ``rising``, shape (curves, 2), hold the samples where each curve turns and
    where it is at saturation again, in the order of the drive at the turns; one may be empty.
    ``end`` is the sample at negative saturation that follows the last curve.
    """

    falling: Samples
    rising: Samples
    end: int

    def of(self, inputs: Array, outputs: Array) -> list[ReversalCurve]:
        """Take the curves, falling ones first, from signals of the record's length."""
        spans = np.concatenate([self.falling, self.rising])
        return [ReversalCurve(inputs[a : b + 1], outputs[a : b + 1]) for a, b in spans]

    def saturations(self, outputs: Array) -> tuple[Array, Array]:
        """Outputs at each visit to negative and to positive saturation."""
        whole_fall, whole_rise = self.falling[-1:, 0], self.rising[:1, 0]
        low = self.falling[:, 1] if len(self.falling) else whole_rise
        high = self.rising[:, 1] if len(self.rising) else whole_fall
        return outputs[low], outputs[high]


def reversal_curves(drive: Array) -> ReversalCurves:
    """Find the curves in a drive (V), shape (n,).

    Raises InputError unless one family at least goes from saturation to saturation without a gap.
    """
    turns = turning_points(drive)
    falling, rising = _families(drive, turns)
    if len(falling) + len(rising) == 0:
        raise InputError(
            "hysteresis record: no curve leaves saturation and returns to it; drive first-order"
            " reversal curves"
        )
    if (gap := _gap(drive, falling, rising)) is not None:
        raise InputError(
            f"hysteresis record: no curve turns between {gap[0]:.4g} V and {gap[1]:.4g} V; let one"
            " turn at each of many levels from saturation to saturation, as far apart as the next"
        )
    last = max(spans[:, 1].max() for spans in (falling, rising) if len(spans))
    after = turns[(drive[turns] <= drive.min() + _near(drive)) & (turns >= last)]
    end = int(after[0]) if len(after) else len(drive)
    return ReversalCurves(_sorted(falling, drive), _sorted(rising, drive), end)


def _near(drive: Array) -> float:
    return ON_SATURATION * float(np.ptp(drive))


def _families(drive: Array, turns: Samples) -> tuple[Samples, Samples]:
    """Turn and return of each curve, falling and rising, both (curves, 2).

    A record may begin or end in saturation, but one that begins at 0 V may begin depolarised.
    """
    ends = np.concatenate([[0] if drive[0] else [], turns, [len(drive) - 1]]).astype(np.int64)
    falling = _spans(ends, drive[ends] <= drive.min() + _near(drive))
    return falling, _spans(ends, drive[ends] >= drive.max() - _near(drive))


def _spans(turns: Samples, saturated: NDArray[np.bool_]) -> Samples:
    """Turn and return of each excursion from one saturation, shape (curves, 2)."""
    first = np.flatnonzero(saturated[:-2] & ~saturated[1:-1] & saturated[2:]) + 1
    return np.column_stack([turns[first], turns[first + 1]])


def _sorted(spans: Samples, drive: Array) -> Samples:
    return spans[np.argsort(drive[spans[:, 0]], kind="stable")]


def _levels(drive: Array, spans: Samples) -> Array:
    """Levels (V) at which curves turn, ascending."""
    turned = np.sort(drive[spans[:, 0]])
    return np.asarray(turned[np.diff(turned, prepend=-np.inf) > _near(drive)])


def _gap(drive: Array, falling: Samples, rising: Samples) -> tuple[float, float] | None:
    """Stretch (V) that the curves of one family leave without a turn; None where there is none."""
    for spans, toward in ((falling, float(drive.max())), (rising, float(drive.min()))):
        levels = _levels(drive, spans)
        if len(levels) == 0:
            continue
        farthest = float(levels[np.abs(levels - toward).argmin()])
        if abs(farthest - toward) > _near(drive):
            return min(farthest, toward), max(farthest, toward)
        gaps = np.diff(levels)
        about = [gaps[max(k - ABOUT, 0) : k + ABOUT + 1] for k in range(len(gaps))]
        wide = np.flatnonzero(gaps > [WIDEST_GAP * np.median(each) for each in about])
        if len(wide):
            return float(levels[wide[0]]), float(levels[wide[0] + 1])
    return None


def turning_points(drive: Array) -> Samples:
    """Samples where the drive turns round, the first of each where it pauses there."""
    moving = np.flatnonzero(np.diff(drive))
    rising = np.diff(drive)[moving] > 0.0
    return np.asarray(moving[:-1][rising[:-1] != rising[1:]] + 1, dtype=np.int64)


SIGNIFICANT = 0.05
FEWEST_TURNS = 3
"""Turns of the drive after the reversal curves without which nothing judges the fit."""


def can_judge(drive: Array) -> bool:
    """Whether a drive (V), shape (n,), has loops enough to judge a fit by."""
    return len(turning_points(drive)) >= FEWEST_TURNS


@frozen(eq=False)
class FreshLoops:
    """Drive predicted minus recorded, V, over held-out loops; both (n,).

    ``exact`` inverts the forward surface, ``direct`` is the paper's inverse surface.
    """

    exact: Array
    direct: Array


def fresh_loops(model: HysteresisModel, drive: Array, effective: Array, start: int) -> FreshLoops:
    """Predict a record's drive (V) from its measured F (V), both (n,), by both inverses.

    The loops begin with sample ``start``, at negative saturation. Noise at the ends of F's range,
    where the inverses refuse, is cut off.
    """
    error = _exact_error(model, drive, effective, start)
    drive, effective = drive[start:], effective[start:]
    direct = Preisach(model.direct)
    within = np.clip(effective, direct.surface.lower, direct.surface.upper)
    paper = direct.apply(direct.saturated(), within)[1]
    return FreshLoops(error, paper - drive)


def _exact_error(model: HysteresisModel, drive: Array, effective: Array, start: int) -> Array:
    """Error (V) of the drive that the exact inverse predicts, from a sample on.

    A Duhem operator never forgets a motion, noise included. So it predicts F from the whole drive,
    and what it misses counts by the chord.
    """
    forward = model.forward
    if isinstance(forward, EverettSurface):
        return drive_error(forward, model.output, drive[start:], effective[start:])
    effect = effect_of(forward)
    predicted = effect.apply(effect.at_rest(), drive)[1]
    return np.asarray((effective - predicted)[start:] / forward.chord)


def drive_error(
    surface: EverettSurface, output: OutputMap | None, drive: Array, effective: Array
) -> Array:
    """Drive that the exact inverse predicts minus the recorded one, V; see ``fresh_loops``."""
    forward = Preisach(surface)
    before = effective if output is None else output.input(effective)
    within = np.clip(before, surface.output_lower, surface.output_upper)
    return np.asarray(forward.invert(forward.saturated(), within)[1] - drive)


def is_better(errors: Array, than: Array, drive: Array) -> bool:
    """Whether errors are less than others, all of shape (n,), on the branches of a drive (V)."""
    cuts = turning_points(drive)
    one, other = (
        [float(np.mean(branch**2)) for branch in np.split(error, cuts)] for error in (errors, than)
    )
    found: float = ttest_rel(one, other, alternative="less").pvalue
    return found < SIGNIFICANT
