"""First-order reversal curves as a MicroMag 2900/3900 magnetometer writes them.

A heading of ``key = value`` lines, then for each curve one drift point, measured at saturation,
and the curve from its reversal field up, blank lines between; each line is field, moment. The
last line marks the end of the file.
"""

from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from attrs import field, frozen

from afm_scan_bench.measured.reversal_curve import ReversalCurve
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.yaml import read_text

FORMAT = "MicroMag"
COLUMNS = 2
"""Field and moment."""
LEAST_POINTS = 2
"""Points that make a curve."""


@frozen(eq=False)
class MicroMagRecord:
    """Curves of moment (emu) over field (Oe), in the order they were measured.

    ``drift``, shape (curves, 2), holds field and moment at saturation before each curve.
    """

    curves: tuple[ReversalCurve, ...] = field(repr=False)
    drift: Array = field(repr=False)


@frozen(eq=False)
class _Block:
    """Consecutive lines of numbers, the first of them ``line``, shape (lines, 2)."""

    line: int
    numbers: Array


def read_micromag(path: Path) -> MicroMagRecord:
    """Read curves and drift points.

    Raises InputError naming the line where the file is of another format, cut short or broken.
    """
    lines = read_text(path).splitlines()
    if not lines or not lines[0].startswith(FORMAT):
        raise InputError(f"{path}: line 1 does not begin with '{FORMAT}': give a MicroMag file")
    if not lines[-1].startswith(FORMAT):
        raise InputError(
            f"{path}: line {len(lines)} is not the last of a {FORMAT} file, which was cut short:"
            " export it again"
        )
    blocks = tuple(_blocks(path, lines[:-1]))
    drift, curves = blocks[0::2], blocks[1::2]
    _refuse_wrong_count(path, lines, len(curves))
    for point, curve in zip(drift, curves, strict=False):
        _refuse_wrong_pair(path, point, curve)
    points = np.concatenate([point.numbers for point in drift])
    return MicroMagRecord(tuple(ReversalCurve(*curve.numbers.T) for curve in curves), points)


def _blocks(path: Path, lines: Sequence[str]) -> Iterator[_Block]:
    """Yield the blocks of numbers after the heading, whose lines hold no comma between digits."""
    numbered = enumerate(lines, start=1)
    for data, group in groupby(numbered, key=lambda item: item[1][:1] in tuple("+-0123456789.")):
        block = list(group)
        if data and "/" not in block[0][1]:
            yield _Block(block[0][0], np.array([_numbers(path, *item) for item in block]))


def _numbers(path: Path, line: int, text: str) -> list[float]:
    try:
        numbers = [float(cell) for cell in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != COLUMNS or not np.isfinite(numbers).all():
        raise InputError(
            f"{path}: line {line}: '{text.strip()}' is not a field and a moment with a comma"
            " between: mend the line"
        )
    return numbers


def _refuse_wrong_count(path: Path, lines: Sequence[str], found: int) -> None:
    for number, text in enumerate(lines, start=1):
        key, _, value = text.partition("=")
        if key.strip() == "NCrv" and value.strip() != str(found):
            raise InputError(
                f"{path}: line {number} promises {value.strip()} curves, the file holds {found}:"
                " export it again, whole"
            )


def _refuse_wrong_pair(path: Path, point: _Block, curve: _Block) -> None:
    if len(point.numbers) != 1:
        raise InputError(
            f"{path}: line {point.line}: a curve without a drift point before it: give one line of"
            " field and moment at saturation, and a blank one, before each curve"
        )
    fields = curve.numbers[:, 0]
    if len(fields) < LEAST_POINTS or fields[-1] <= fields[0]:
        raise InputError(
            f"{path}: line {curve.line}: a curve whose field does not rise: leave it out, with its"
            " drift point, or measure it again"
        )
