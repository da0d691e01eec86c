"""Records from files: bags, and tables of text or arrays."""

import math
from pathlib import Path

from afm_scan_ros.api.arrays import channels_of
from afm_scan_ros.api.record import Record
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import KINDS
from afm_scan_ros.core.identification.records.recording import kind_and_axes
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.csv_record import QUANTITIES, Rows, parse_columns, read_table_record

DRIVE, DISPLACEMENT = QUANTITIES["drive"], QUANTITIES["achieved"]


def read_record(
    path: Path | str,
    columns: str | None = None,
    *,
    sample_rate: float | None = None,
    skip_rows: int = 0,
    kind: str | None = None,
    start: str = "unknown",
) -> Record:
    r"""Read a record of drive and displacement from a file.

    Arguments:
        path: a rosbag2 folder, an ``.mcap`` file, or, with ``columns``, a table: text with any
            separator, ``.npy``, or ``.npz``.
        columns: what the table's columns hold, as ``drive_x=1:V,achieved_x=2:um,time=3:ms``: the
            number of a column from 1, or its name in the last line skipped, and its unit. One axis
            is enough.
        sample_rate: Hz, where no column is ``time``.
        skip_rows: lines of the table to leave out at the top.
        kind: see ``Record``; a bag says it by itself.
        start: see ``Record``.

    A bag that was cut short is read as far as it goes: its ``shortcomings`` say what is missing.
    Raises InputError, which names file, place and fix, for what cannot be read, and for samples
    that were not taken just before the converter's update.

    >>> from pathlib import Path
    >>> import afm_scan_ros as afm
    >>> rows = "\n".join(f"{k / 500:.3f} {k / 100:.2f}" for k in range(500))
    >>> _ = Path("ramp.txt").write_text(rows)
    >>> record = afm.read_record("ramp.txt", "drive_x=1:V,achieved_x=2:um", sample_rate=1000.0)
    >>> record.sample_period, float(record.displacement[100, 0])
    (0.001, 1e-06)
    """
    if columns is None:
        return _from_bag(read_scan(Path(path)), kind, start)
    if sample_rate is not None and not 0.0 < sample_rate < math.inf:
        raise InputError(f"sample_rate is {sample_rate:g} Hz: give a positive number")
    chosen = parse_columns(columns)
    axes = [axis for axis in AXES if any(column.name.endswith(f"_{axis}") for column in chosen)]
    absent = [axis for axis in AXES if axis not in axes]
    rows = Rows(skip_rows)
    found = read_table_record(
        [Path(path)],
        chosen,
        rows,
        sample_rate=sample_rate,
        absent=absent[0] if len(absent) == 1 else None,
    )
    for stream in (DRIVE, DISPLACEMENT):
        if stream not in found.streams:
            raise InputError(f"{path}: columns name no {stream}: give drive and achieved")
    drive, displacement = (channels_of(found.streams[s], axes) for s in (DRIVE, DISPLACEMENT))
    return Record(drive, displacement, found.sample_period, axes, kind, start, name=str(path))


def _from_bag(bag: ScanRecording, kind: str | None, start: str) -> Record:
    """Read what a bag holds of both streams, as far as both reach."""
    info, path = bag.info, bag.path
    if info.sampling_instant != "before_update" or info.trigger_offset != 0.0:
        raise InputError(
            f"{path}: sampled {info.sampling_instant} with a trigger offset of"
            f" {info.trigger_offset:g} s; sample just before the converter's update"
        )
    drive, displacement = bag.together(DRIVE, DISPLACEMENT)
    if not len(drive.x):
        mend = "; ".join(bag.warnings) or "record it again"
        raise InputError(f"{path}: holds no samples of drive and displacement; {mend}")
    said, axes = kind_and_axes(info.pattern)
    missing = info.total_samples - len(drive.x)
    lost = [f"{path}: the last {missing} samples are missing"] if missing else []
    return Record(
        channels_of(drive, axes),
        channels_of(displacement, axes),
        info.sample_period,
        axes,
        kind or (said if said in KINDS else None),
        start,
        name=str(path),
        scan=info.spec,
        shortcomings=(*bag.warnings, *lost),
        info=info,
    )
