"""A record of motion → what each cell of the Preisach plane would have made of its drive."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy
from attrs import define, evolve, frozen
from numpy.typing import NDArray
from scipy.signal import lfilter

from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.preisach import depolarising
from afm_scan_ros.core.effects.vibration import VibrationModel, held
from afm_scan_ros.core.identification.records.motion import turning_points
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.density import CellGrid, NormalEquations, swept_areas

ROWS = 4_000
"""Rows of all records together, to which they are averaged; it bounds time and memory of a fit."""
LOOP, RINGING = 40, 400
"""Rows of a swing that show its loop, and those that show what rings after its turns."""
PIECES = 8
"""Parts of a record, of which each can be predicted from the others."""


@frozen(eq=False)
class MovingRecord:
    """Drive (V) and displacement (m), both (n,), of a record in which the scanner moves.

    Where not ``measured`` (n,), the displacement counts nothing. What is measured follows a drive
    that has visited both of its ends, so that the memory is known, whatever it was at the start.
    """

    name: str
    drive: Array
    displacement: Array
    sample_period: float
    measured: NDArray[np.bool_]

    def cut(self, samples: int) -> "MovingRecord":
        """Return the record's first samples."""
        signals = ("drive", "displacement", "measured")
        return evolve(self, **{name: getattr(self, name)[:samples] for name in signals})

    @property
    def swings(self) -> float:
        """Swings of the drive, there and back, a second."""
        ways = 1 + len(turning_points(self.drive))
        return ways / 2.0 / (len(self.drive) * self.sample_period)


@frozen
class LinearDynamics:
    """What follows the hysteresis: a vibration of gain 1 at rest, then creep."""

    vibration: VibrationModel
    creep: CreepModel


@frozen(eq=False)
class LoopPart:
    """Areas (n, p) and displacement (n,), m, of a stretch of a record, or of one of several.

    Each record's are without their means, as the sensor's zero is arbitrary, times the root of the
    samples of a row, so that squares count samples; they count ``samples``. The drive is from
    ``lower`` to ``upper`` (V).
    """

    areas: Array
    moved: Array
    samples: float
    lower: float
    upper: float

    @classmethod
    def of(cls, areas: Array, moved: Array, samples: Array, drive: Array) -> "LoopPart":
        """Take rows that count for ``samples``, and their drive (rows, every)."""
        total, root = float(samples.sum()), np.sqrt(samples)
        areas, moved = (each - samples @ each / total for each in (areas, moved))
        ends = float(drive.min()), float(drive.max())
        return cls(root[:, np.newaxis] * areas, root * moved, total, *ends)

    @classmethod
    def together(cls, parts: Sequence["LoopPart"]) -> "LoopPart":
        """Return several as one."""
        areas, moved = (np.concatenate([getattr(p, n) for p in parts]) for n in ("areas", "moved"))
        ends = min(part.lower for part in parts), max(part.upper for part in parts)
        return cls(areas, moved, sum(part.samples for part in parts), *ends)

    @property
    def equations(self) -> NormalEquations:
        """Equations of the weights of the areas."""
        return NormalEquations.of(self.areas, self.moved, self.samples)


@define(frozen=True, eq=False, slots=False)
class Swept:
    """A record's displacement (m) and areas, averaged over ``every`` samples, (rows, …).

    ``areas`` count from rest at zero. ``measured`` marks the rows that were measured throughout.
    A row counts for ``samples`` (rows,), of which those that another row shows too count half.
    """

    record: MovingRecord
    every: int
    moved: Array
    areas: Array
    measured: NDArray[np.bool_]
    samples: Array

    @property
    def row_period(self) -> float:
        """Seconds between rows."""
        return self.every * self.record.sample_period

    def parts(self, dynamics: LinearDynamics, count: int = PIECES) -> list[LoopPart]:
        """Return so many equal parts of the rows that were measured, behind the dynamics."""
        areas = _creeping(self._vibrating(dynamics.vibration), dynamics.creep, self.row_period)
        drive = self.record.drive[: len(self.moved) * self.every].reshape(len(self.moved), -1)
        rows = [each[self.measured] for each in (areas, self.moved, self.samples, drive)]
        parts = parts_of([len(rows[0])], count)
        return [LoopPart.of(*(each[part] for each in rows)) for part in parts]

    def whole(self, dynamics: LinearDynamics) -> LoopPart:
        """Return all of these rows."""
        return self.parts(dynamics, 1)[0]

    def shared_until(self, last: int) -> "Swept":
        """The same, where other rows show the samples before ``last`` too: each counts half."""
        share = np.where(np.arange(len(self.moved)) * self.every < last, 0.5, 1.0)
        return evolve(self, samples=share * self.samples)

    def _vibrating(self, vibration: VibrationModel) -> Array:
        """Pass the areas through the vibration behind the converter's hold, exactly."""
        length, spectrum = self._transformed
        omega: Array = 2.0 * np.pi * scipy.fft.rfftfreq(length, self.row_period)
        response = held(vibration, self.record.sample_period).response(omega)
        result = np.empty_like(self.areas)
        for column, lines in enumerate(spectrum):
            result[:, column] = scipy.fft.irfft(lines * response, length)[: len(result)]
        return result

    @cached_property
    def _transformed(self) -> tuple[int, NDArray[np.complex128]]:
        """Length and transform of the areas, (columns, lines), run back to zero at their end."""
        rows, columns = self.areas.shape
        length = scipy.fft.next_fast_len(rows + rows // PIECES + LOOP, real=True)
        padded = np.zeros((columns, length))
        padded[:, :rows] = self.areas.T
        back = 0.5 + 0.5 * np.cos(np.linspace(0.0, np.pi, length - rows))
        padded[:, rows:] = np.outer(self.areas[-1], back)
        return length, np.asarray(scipy.fft.rfft(padded))


def _creeping(areas: Array, creep: CreepModel, period: float) -> Array:
    """Add creep, whose sections see the mean of the input over each ``period`` (s)."""
    result = areas
    for gain, time_constant in zip(creep.gains, creep.time_constants, strict=True):
        kept = np.exp(-period / time_constant)
        result = result + lfilter([0.0, gain * (1.0 - kept)], [1.0, -kept], areas, axis=0)
    return result


def swept(records: Sequence[MovingRecord], grid: CellGrid) -> Iterator[Swept]:
    """Sweep the cells of a grid by the drives of all records; each keeps its share of ``ROWS``.

    A record that is averaged over more than its ringing bears gives its first swings once more,
    in rows that show the ringing. Each sample counts once in all.
    """
    total = sum(len(record.drive) for record in records)
    for record in records:
        per_swing = 1.0 / (record.swings * record.sample_period)
        every = min(max(1, -(-total // ROWS)), max(1, int(per_swing / LOOP)))
        whole = _swept(record, grid, every)
        if (finer := max(1, int(per_swing / RINGING))) < every:
            begin = record.drive[: ROWS // len(records) * finer]
            part = _swept(record.cut(len(begin)), grid, finer)
            if part.measured.any():
                yield whole.shared_until(len(begin))
                yield part.shared_until(len(begin))
                continue
        yield whole


def _swept(record: MovingRecord, grid: CellGrid, every: int) -> Swept:
    record = record.cut(ROWS * every)
    before = depolarising(grid.lower, grid.upper, 0.0)
    areas = swept_areas(record.drive, grid, before, every)
    rest = swept_areas(np.zeros(1), grid, before)[0]
    moved = record.displacement[: len(areas) * every].reshape(-1, every).mean(axis=1)
    measured = np.all(record.measured[: len(areas) * every].reshape(-1, every), axis=1)
    samples = np.full(len(moved), float(every))
    return Swept(record, every, moved, areas - rest, measured, samples)


def parts_of(lengths: Sequence[int], count: int = PIECES) -> list[slice]:
    """Equal parts, ``count`` many, of each of several runs of rows that follow each other."""
    found, first = [], 0
    for length in lengths:
        edges = first + np.linspace(0, length, count + 1).astype(int)
        found += [slice(a, b) for a, b in pairwise(edges) if a < b]
        first += length
    return found


def loop_parts(records: Sequence[Swept], dynamics: LinearDynamics) -> list[LoopPart]:
    """Eighths of each loop; records whose drive has the same range share theirs."""
    groups: dict[tuple[float, int], list[LoopPart]] = {}
    for one in records:
        for number, part in enumerate(one.parts(dynamics)):
            groups.setdefault((float(np.ptp(one.record.drive)), number), []).append(part)
    return [LoopPart.together(group) for group in groups.values()]
