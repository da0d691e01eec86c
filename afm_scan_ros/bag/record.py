"""Records read from bags and from tables."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.arguments import of_type, positive, whole
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import KINDS
from afm_scan_ros.core.identification.records.recording import kind_and_axes
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES, Trace, channels_of
from afm_scan_ros.files.columns import USE, parse_columns, read_table_record
from afm_scan_ros.files.paths import path_of
from afm_scan_ros.files.text_table import RowRange

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

    Parameters
    ----------
    path
        A rosbag2 folder, an ``.mcap`` file, or a table: text with any separator and heading,
        ``.npy``, ``.npz`` or ``.mat``.
    columns
        What the table's columns hold, as ``drive_x=1:V,achieved_x=2:um,time=3:ms``: the number of a
        column from 1, or its heading, and its unit. Any number of axes, by any names. Not needed
        where the headings state it, as ``drive_x [V]``. A unit may have a factor: ``-um`` turns a
        sensor's sign, ``8um/V`` is for a sensor in V, of which 1 V stands for 8 µm. Where that
        scale is unknown, any will do: lengths are then relative.
    sample_rate
        Hz, where no column is ``time``.
    skip_rows
        Lines of the table to leave out at the top; a heading is found without.
    kind
        See ``Record``; a bag states it by itself.
    start
        See ``Record``.
    topics
        Topics of a bag, as ``{"achieved_displacement": "/lab/position"}``. Not needed where their
        names or message types say it.

    Returns
    -------
    Record
        Its ``shortcomings`` name what is missing in a bag, or not even in a table's times. A bag
        without ``scan_info`` is taken as sampled just before the converter's update.

    Raises
    ------
    InputError
        For what cannot be read, naming file, place and fix, and for samples that were taken at a
        distance from the converter's update.

    Examples
    --------
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
        moving = (a for a in AXES if any(np.ptp(trace.axis(a)) for trace in (drive, displacement)))
        axes = tuple(moving) or AXES
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


def _shortcomings(bag: ScanRecording, drive: Trace) -> list[str]:
    found = []
    first, samples = drive.first_sample, len(drive.x)
    if first:
        found.append(f"{bag.path}: the first {first} samples are missing")
    if missing := bag.missing(first + samples):
        found.append(f"{bag.path}: the last {missing} samples are missing")
    return found
