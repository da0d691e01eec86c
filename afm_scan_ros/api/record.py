"""A record: drive and measured displacement of a scanner, from arrays, bags or tables."""

import logging
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike

from afm_scan_ros.api.arguments import (
    SPEC,
    axes_of,
    channels_of,
    of_type,
    period_of,
    positive,
    refuse_other_count,
    samples,
    trace_of,
    whole,
)
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import KINDS
from afm_scan_ros.core.identification.records.recording import kind_and_axes
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.files.columns import USE, parse_columns, read_table_record
from afm_scan_ros.files.paths import path_of
from afm_scan_ros.files.text_table import RowRange

if TYPE_CHECKING:
    from afm_scan_ros.bag.scan_info import ScanInfo

LOG = logging.getLogger(__name__)

STARTS = ("unknown", "depolarised")


def _drive(given: ArrayLike) -> Array:
    return samples("drive", given)


def _displacement(given: ArrayLike) -> Array:
    return samples("displacement", given)


def _shape(values: Array) -> str:
    return f"<{values.shape}>"


@frozen(eq=False)
class Record:
    """Drive and measured displacement against time, of any number of axes, evenly sampled.

    Arguments:
        drive: V, shape (n,) or (n, channels); kept as (n, channels).
        displacement: m, as long, measured just before each update of the drive. Its zero is taken
            from the record itself, so that a sensor's offset does not matter.
        sample_period: s.
        axes: the axis of each channel of the displacement, and of the drive where it has as many.
            Models of hysteresis and creep are of "x" and "y".
        kind: what the record was made for: "creep", "frequency", "hysteresis", "validation", or
            an experiment of ``afm-scan calibrate``. None where that is to be recognised.
        start: "depolarised" where the scanner's hysteresis is known to begin so; "unknown" has
            ``diagnose`` estimate its initial state.
        name: what messages and reports call it.
        scan: the scan that it is a record of, if of any. Its lines separate level and motion.
        shortcomings: what is missing in the file that it was read from, in sentences. Whatever
            uses the record logs them as warnings, or refuses it.
        info: what its bag states of it.

    Raises InputError for shapes that do not pair, for what is not finite, a sample period that is
    not positive, an axis given twice, and an unknown kind or start.

    >>> import numpy as np
    >>> import afm_scan_ros as afm
    >>> drive = np.sin(np.linspace(0.0, 6.28, 1000))
    >>> record = afm.Record(drive, 5e-6 * drive, sample_period=1e-4)
    >>> record.drive.shape, record.axes
    ((1000, 1), ('x',))
    """

    drive: Array = field(converter=_drive, repr=_shape)
    displacement: Array = field(converter=_displacement, repr=_shape)
    sample_period: float = field(converter=period_of)
    axes: tuple[str, ...] = field(default=("x",), converter=axes_of)
    kind: str | None = None
    start: str = "unknown"
    name: str = field(default="", kw_only=True)
    scan: ScanSpec | None = field(default=None, kw_only=True)
    shortcomings: tuple[str, ...] = field(default=(), kw_only=True)
    info: "ScanInfo | None" = field(default=None, kw_only=True, repr=False)

    def __attrs_post_init__(self) -> None:
        refuse_other_count("displacement", self.displacement, self.axes)
        if len(self.drive) != len(self.displacement):
            raise InputError(
                f"drive has {len(self.drive)} samples and displacement {len(self.displacement)}:"
                " give one displacement for each drive"
            )
        if self.kind is not None and self.kind not in KINDS:
            raise InputError(f"kind {self.kind!r} is unknown: give one of {', '.join(KINDS)}")
        if self.start not in STARTS:
            raise InputError(f"start {self.start!r} is unknown: give one of {', '.join(STARTS)}")
        if self.scan is not None:
            of_type(ScanSpec, "scan", self.scan, SPEC)

    @property
    def missing(self) -> int:
        """Samples that the record's bag announces and does not hold."""
        return 0 if self.info is None else self.info.total_samples - len(self.drive)

    def traces(self) -> tuple[Trace, Trace]:
        """Return drive (V) and displacement (m) of both axes; an absent axis is zero.

        Logs the shortcomings. Raises InputError for other axes than x and y.
        """
        if not set(self.axes) <= set(AXES):
            raise InputError(
                f"{self.name or 'record'}: its axes are {', '.join(self.axes)}: name them x and y,"
                " unless the scanner has coupled axes"
            )
        refuse_other_count("drive", self.drive, self.axes)
        for shortcoming in self.shortcomings:
            LOG.warning("%s", shortcoming)
        drive, displacement = (
            trace_of(values, self.axes, self.sample_period)
            for values in (self.drive, self.displacement)
        )
        return drive, displacement


DRIVE, DISPLACEMENT = "drive_voltage", "achieved_displacement"


def read_record(
    path: Path | str,
    columns: str | None = None,
    *,
    sample_rate: float | None = None,
    skip_rows: int = 0,
    kind: str | None = None,
    start: str = "unknown",
    topics: Mapping[str, str] = MappingProxyType({}),
) -> Record:
    r"""Read a record of drive and displacement from a file.

    Arguments:
        path: a rosbag2 folder, an ``.mcap`` file, or a table: text with any separator and heading,
            ``.npy``, ``.npz`` or ``.mat``.
        columns: what the table's columns hold, as ``drive_x=1:V,achieved_x=2:um,time=3:ms``: the
            number of a column from 1, or its heading, and its unit. Any number of axes, by any
            names. Not needed where the headings state it, as ``drive_x [V]``.
        sample_rate: Hz, where no column is ``time``.
        skip_rows: lines of the table to leave out at the top; a heading is found without.
        kind: see ``Record``; a bag states it by itself.
        start: see ``Record``.
        topics: topics of a bag, as ``{"achieved_displacement": "/lab/position"}``. Not needed where
            their names or message types say it.

    A unit may have a factor: ``-um`` turns a sensor's sign, ``8um/V`` is for a sensor in V, of
    where 1 V stands for 8 µm. Where that scale is unknown, any will do: lengths are then relative.
    A bag without ``scan_info`` is taken as sampled just before the converter's update. The
    record's ``shortcomings`` name what is missing in a bag, or not even in a table's times.
    Raises InputError, which names file, place and fix, for what cannot be read, and for samples
    that were taken at a distance from the converter's update.

    >>> from pathlib import Path
    >>> import afm_scan_ros as afm
    >>> rows = "\n".join(f"{k / 500:.3f};{k / 100:.2f}" for k in range(500))
    >>> _ = Path("ramp.txt").write_text("drive_x [V];achieved_x [um]\n" + rows)
    >>> record = afm.read_record("ramp.txt", sample_rate=1000.0)
    >>> record.sample_period, float(record.displacement[100, 0])
    (0.001, 1e-06)
    """
    path = path_of(path, "scan.mcap")
    if not path.exists():
        raise InputError(
            f"{path} does not exist: give a table (text, .npy, .npz or .mat), a rosbag2 folder or"
            " an .mcap file"
        )
    if columns is None and not is_table(path):
        return _from_bag(read_scan(path, topics), kind, start)
    skip_rows = whole("skip_rows", skip_rows, 0)
    if sample_rate is not None:
        sample_rate = positive("sample_rate", sample_rate, "in Hz, as 1e5")
    chosen = None if columns is None else parse_columns(of_type(str, "columns", columns, USE))
    found = read_table_record([path], chosen, RowRange(skip_rows), sample_rate)
    for quantity in ("drive", "achieved"):
        if quantity not in found.signals:
            raise InputError(f"{path}: no column is {quantity}: {USE}")
    drive, displacement = (
        np.stack([found.signals[quantity][axis] for axis in found.axes], axis=1)
        for quantity in ("drive", "achieved")
    )
    return Record(
        drive,
        displacement,
        found.sample_period,
        found.axes,
        kind,
        start,
        name=str(path),
        shortcomings=found.notes,
    )


def is_table(path: Path) -> bool:
    """Whether a path is a table of numbers, and no bag."""
    return path.is_file() and path.suffix != ".mcap"


def _from_bag(bag: ScanRecording, kind: str | None, start: str) -> Record:
    """Read what a bag holds of both streams, as far as both reach.

    Just before an update and just after it the displacement is the same: no mass jumps.
    """
    info, path = bag.info, bag.path
    if info.trigger_offset != 0.0:
        raise InputError(
            f"{path}: its displacement was sampled {info.trigger_offset:g} s from the converter's"
            " update (trigger_offset); sample at the update, just before it or just after it"
        )
    drive, displacement = bag.together(DRIVE, DISPLACEMENT)
    if not len(drive.x):
        mend = "; ".join(bag.warnings) or "record it again"
        raise InputError(f"{path}: holds no samples of drive and displacement; {mend}")
    stated_kind, axes = kind_and_axes(info.pattern)
    if not bag.stated:
        axes = _axes_that_move(drive, displacement)
    return Record(
        channels_of(drive, axes),
        channels_of(displacement, axes),
        info.sample_period,
        axes,
        kind or (stated_kind if stated_kind in KINDS else None),
        start,
        name=str(path),
        scan=None if drive.first_sample else info.spec,
        shortcomings=(*bag.warnings, *_shortcomings(bag, drive)),
        info=info if bag.stated else None,
    )


def _axes_that_move(*traces: Trace) -> tuple[str, ...]:
    """Name the axes that are driven or move; both where none does."""
    found = (axis for axis in AXES if any(_moves(trace.axis(axis)) for trace in traces))
    return tuple(found) or AXES


def _moves(values: Array) -> bool:
    return bool(np.ptp(values))


def _shortcomings(bag: ScanRecording, drive: Trace) -> list[str]:
    """Say what a bag does not hold of its record."""
    found = []
    first, samples = drive.first_sample, len(drive.x)
    if first:
        found.append(f"{bag.path}: the first {first} samples are missing")
    if missing := bag.missing(first + samples):
        found.append(f"{bag.path}: the last {missing} samples are missing")
    return found
