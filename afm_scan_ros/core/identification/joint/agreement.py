"""Whether records are of one scanner: the gain and the loops of each beside those of the others."""

from collections.abc import Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.joint.cells import CellGrid
from afm_scan_ros.core.identification.joint.density import diagonal
from afm_scan_ros.core.identification.joint.moving import Dynamics, MovingRecord, Swept, swept
from afm_scan_ros.core.identification.joint.search import jackknife, parts_of
from afm_scan_ros.core.identification.records.matches import LIKE_GAINS

UNITS = 10.0 ** np.array([0, -3, -6, -9])
"""Of length that a column is given in, m."""
DIGITS = 6
"""Of the logarithm of a gain: two records differ equally from their median; loops then decide."""


@frozen
class _Response:
    """Gain (m/V) of a record, and how wide its loops open for each volt of its drive.

    Loops open in proportion to the drive, and by more the farther it goes (Rayleigh). Those that go
    the way of a hysteresis, the displacement late, are positive. ``half`` is the half-width of
    their 95 % interval, infinite where the drive mostly rests and there are none.
    """

    name: str
    gain: float
    loops: float
    half: float

    @classmethod
    def of(cls, one: Swept, dynamics: Dynamics, grid: CellGrid) -> "_Response":
        """Fit a curved line, parabolas that close where the drive turns (Rayleigh), and a delay."""
        everywhere = np.ones_like(one.memory_known)  # neither asks for the memory
        areas, moved = evolve(one, memory_known=everywhere).regression(dynamics)
        line = areas[:, diagonal(grid.cells)].sum(axis=1) * (0.5 * grid.width / grid.cells)
        span = float(np.ptp(line))
        across = 2.0 * (line - line.min()) / span - 1.0
        speed = np.gradient(line)
        opening = -(span**2) * np.sign(speed) * (1.0 - across**2)
        columns = np.column_stack([line, span * across**2, opening, speed])
        columns -= columns.mean(axis=0)
        found = np.linalg.lstsq(columns, moved, rcond=None)[0]
        half = jackknife(parts_of([len(moved)]), columns, moved - columns @ found)
        gain = float(line @ moved / (line @ line))
        wide = (
            float(half[2] / abs(gain)) if np.median(np.abs(np.diff(one.record.drive))) else np.inf
        )
        return cls(one.record.name, gain, float(found[2] / gain), wide)


def refuse_inconsistent(
    records: Sequence[MovingRecord], dynamics: Dynamics, grid: CellGrid
) -> None:
    """Refuse a record that is not of the scanner of the others, or has its columns exchanged.

    The hysteresis of one scanner changes its gain by less than ``LIKE_GAINS``. Where the gain is
    1 in the units of the columns, exchanged ones show by their loops: these go the other way, with
    95 % confidence, and are about as wide. Raises InputError, which names the record.
    """
    whole = {one.record.name: one for one in reversed(list(swept(records, grid)))}
    responses = [_Response.of(one, dynamics, grid) for one in whole.values()]
    if len(responses) < 2:  # noqa: PLR2004 - nothing to compare with
        return
    usual = float(np.exp(np.median(np.log([abs(one.gain) for one in responses]))))
    backward = sorted(responses, key=lambda one: one.loops)
    worst = max(backward, key=lambda one: round(abs(np.log(abs(one.gain) / usual)), DIGITS))
    others = [one for one in responses if one is not worst]
    beside = float(np.median([one.gain for one in others]))
    if not LIKE_GAINS[0] <= worst.gain / beside <= LIKE_GAINS[1]:
        _refuse_gain(worst, others, beside)
    looping = [one for one in responses if np.isfinite(one.half)]
    for one in looping:
        least = min((each.loops - each.half for each in looping if each is not one), default=0.0)
        if one.loops + one.half < 0.0 < least and -one.loops > LIKE_GAINS[0] * least:
            raise InputError(
                f"{one.name}: its displacement runs ahead of its drive, as wide as those of the"
                " other records lag: its two columns are exchanged; name them the other way round"
            )


def _refuse_gain(worst: _Response, others: Sequence[_Response], beside: float) -> None:
    reference = others[0].name if len(others) == 1 else "the other records"
    ratio = worst.gain * beside / UNITS**2
    exchanged = np.any((ratio > LIKE_GAINS[0]) & (ratio < LIKE_GAINS[1]))
    why = (
        "its drive and displacement columns are exchanged; name them the other way round"
        if exchanged
        else "it is of another axis, scanner, unit or amplifier; leave it out, or give its units"
    )
    raise InputError(
        f"{worst.name}: it moves {1e9 * worst.gain:.4g} nm per volt, but {reference}"
        f" {1e9 * beside:.4g} nm: {why}"
    )
