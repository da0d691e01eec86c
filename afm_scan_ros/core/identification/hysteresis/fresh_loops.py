"""Held-out loops: how well each inverse predicts their drive, and which does so better.

The drive is predicted from the effective input, as a scan's is. Errors last from one turn of the
drive to the next, so that samples add little to the branches between turns. One inverse
counts as better than a simpler one where Student's paired test of the branches' mean squares says
so, one-sided, at SIGNIFICANT.
"""

import numpy as np
from attrs import frozen
from scipy.stats import ttest_rel

from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.operators import effect_of
from afm_scan_ros.core.effects.hysteresis.output_map import OutputMap
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.identification.hysteresis.reversal_curves import turning_points
from afm_scan_ros.core.model import HysteresisModel
from afm_scan_ros.core.types import Array

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
