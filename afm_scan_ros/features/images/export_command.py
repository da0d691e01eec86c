"""``afm-scan export``: images and signals of a bag for other programs."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import click
import numpy as np

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import runs
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.bag.typestore import IMAGE, decode, heights, way_of
from afm_scan_ros.cli.options import NEW_FILE, RECORD, refuse_existing, topic_option, warn
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.image_lines import Frame, ImageLine, LineImager, frame_of, most_pixels
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import within
from afm_scan_ros.core.trajectory import TO_AND_FRO, phases
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.features.images.files.channels import (
    LINE_TIME,
    OVERSCAN,
    SLOW_DIRECTION,
    ImageChannel,
)
from afm_scan_ros.features.images.files.formats import WRITTEN, write_image
from afm_scan_ros.files import PACKAGE, version
from afm_scan_ros.files.columns import Signal, write_signals
from afm_scan_ros.files.records import to_mapping
from afm_scan_ros.report.analysis import scan_spec
from afm_scan_ros.report.page import UNSTATED, source_of
from afm_scan_ros.report.terminal import say

TEXT, NETCDF = ".csv", ".nc"
PIXELS = 256
STREAMS = ("desired_displacement", "achieved_displacement")
"""What images of errors and positions need."""
TOPOGRAPHY = "Topography"
SIGNALS = {
    "desired_displacement": ("desired", "m"),
    "achieved_displacement": ("achieved", "m"),
    "drive_voltage": ("drive", "V"),
    "true_displacement": ("true", "m"),
}
"""Streams of a bag, and their names and units in a table. ``import-csv`` takes no ``true``."""


@click.command()
@click.argument("bag", type=RECORD)
@click.option(
    "--to",
    "target",
    type=NEW_FILE,
    required=True,
    help="File to write. The suffix gives the format: .gwy, .gsf, .nc or .csv.",
)
@click.option(
    "--pixels",
    type=click.IntRange(2),
    help="Pixels in a line. By default those of the recorded image, or else 256.",
)
@topic_option
def export(bag: Path, target: Path, pixels: int | None, topics: Mapping[str, str]) -> None:
    """Write the images and signals of BAG, a rosbag2 folder or an .mcap file, for other programs.

    .gwy and .gsf (Gwyddion) hold images of the heights, errors and positions. .csv holds the
    signals, one row a sample, and .nc (netCDF-4) both.
    """
    suffix = target.suffix.lower()
    if suffix not in {TEXT, *WRITTEN}:
        raise InputError(f"{target}: unknown format: give {', '.join((*WRITTEN, TEXT))}")
    if suffix == TEXT and pixels is not None:
        raise InputError(f"--pixels {pixels}: a table holds no image: leave it out")
    refuse_existing(target, other="file")
    with working("export", at_once=False) as progress:
        progress("reading the bag")
        recording = read_scan(bag, topics)
        progress("writing the file")
        files, channels, signals = _written(recording, target, pixels)
    warn(recording.warnings)
    _say(files, channels, signals)
    if shortcomings := list(_shortcomings(recording, channels, signals)):
        raise ScanError(f"{recording.path}: the scan is incomplete: {'; '.join(shortcomings)}")


def _written(
    recording: ScanRecording, target: Path, pixels: int | None
) -> tuple[Sequence[Path], Sequence[ImageChannel], Sequence[Signal]]:
    """Write what the suffix asks for; return the files, and the channels and signals in them."""
    suffix = target.suffix.lower()
    if suffix == TEXT:
        signals = _signals(recording, [name for name in SIGNALS if name != "true_displacement"])
        write_signals(target, signals)
        return (target,), (), signals
    signals = _signals(recording, list(SIGNALS)) if suffix == NETCDF else ()
    spec = recording.info.spec
    lines = recording.stated and spec is not None and spec.pattern in TO_AND_FRO
    imaged = suffix != NETCDF or lines
    channels = scan_channels(recording, scan_spec(recording), pixels) if imaged else ()
    missing = [name for name in STREAMS if name not in recording.topics]
    if imaged and missing:
        without = f"{recording.path}: holds no {' and no '.join(missing)}"
        if not (channels or signals):
            raise InputError(f"{without}: record it too, or export signals to .nc or .csv")
        warn([f"{without}, so there are no images of errors and positions"])
    return write_image(target, channels, _stated(recording), signals), channels, signals


def _shortcomings(
    recording: ScanRecording, channels: Sequence[ImageChannel], signals: Sequence[Signal]
) -> Iterator[str]:
    """Say how much is missing of what was written."""
    spec = recording.info.spec
    if channels and spec is not None and (whole := len(channels[-1].values)) < spec.lines:
        yield f"{whole} of {spec.lines} lines of the scan are whole"
    if signals:
        end = round(signals[0].values[-1] / recording.info.sample_period) + 1
        if missing := recording.missing(end):
            yield f"the last {missing} samples are missing"


def _signals(recording: ScanRecording, names: Sequence[str]) -> tuple[Signal, ...]:
    """Return time and the samples that all streams hold."""
    there = [name for name in names if name in recording.topics]
    if not there:
        raise InputError(f"{recording.path}: holds no samples of a scanner: give another bag")
    traces = recording.together(*there)
    first, count = traces[0].first_sample, len(traces[0].x)
    if not count:
        raise InputError(f"{recording.path}: holds no samples that all its streams have")
    time: Array = recording.info.sample_period * np.arange(first, first + count, dtype=float)
    found = [Signal("time", "s", time)]
    for name, trace in zip(there, traces, strict=True):
        quantity, unit = SIGNALS[name]
        found += [Signal(f"{quantity}_{axis}", unit, trace.axis(axis)) for axis in AXES]
    return tuple(found)


def _stated(recording: ScanRecording) -> dict[str, str]:
    """Return the provenance of a scan: who wrote it, of which scan, with which model."""
    info = recording.info
    source = source_of(str(recording.path), info, info.total_samples)
    found = {
        "written_by": f"{PACKAGE} {version()}",
        "bag": source.bag,
        "scan_id": source.scan_id,
        "recorded": source.recorded or UNSTATED,
        "sample_rate_hz": repr(source.sample_rate),
        "model_hash": source.model_hash or "none",
        "inverses": ", ".join(info.inverses) or "none",
        "sampling_instant": info.sampling_instant,
    }
    if info.spec is None:
        return {**found, "pattern": info.pattern}
    scan = {f"scan_{key}": str(value) for key, value in to_mapping(info.spec).items()}
    imaged = {
        LINE_TIME: repr(1.0 / info.spec.line_rate),
        SLOW_DIRECTION: "up",
        OVERSCAN: repr(info.spec.overscan / (1.0 - 2.0 * info.spec.overscan)),
    }
    return {**found, **scan, **imaged}


def _say(
    files: Sequence[Path], channels: Sequence[ImageChannel], signals: Sequence[Signal]
) -> None:
    if len(files) > 1:
        for file, channel in zip(files, channels, strict=True):
            say(f"{file} holds {channel.title}.")
    elif channels:
        lines, pixels = channels[0].values.shape
        names = ", ".join(dict.fromkeys(channel.name for channel in channels))
        say(f"{files[0]} holds {names}: {lines} lines of {pixels} pixels.")
    if signals:
        say(f"{files[0]} holds {len(signals[0].values)} samples of each signal.")


def scan_channels(
    recording: ScanRecording, spec: ScanSpec, pixels: int | None = None
) -> tuple[ImageChannel, ...]:
    """Return all channels that a bag holds of a scan, in m, trace and retrace each.

    First the images that were recorded. Then the errors and the achieved positions of x and y, if
    the bag holds both displacements: the means over each pixel of the desired line, of the lines
    that are whole. There are as many ``pixels`` as in the recorded image, or else 256, or as many
    as a trace has samples for.
    Raises InputError where the pattern has no lines, where no line is whole, and for ``pixels``
    beside a recorded image of other width.
    """
    recorded = _recorded_images(recording.path)
    widths = {values.shape[1] for values in recorded.values()}
    if len(widths | ({pixels} if pixels else set())) > 1:
        raise InputError(
            f"{recording.path}: its image has {' or '.join(map(str, sorted(widths)))} pixels in a"
            f" line, not {pixels}: leave the number of pixels out"
        )
    frame = frame_of(spec, pixels or next(iter(widths), min(PIXELS, most_pixels(spec))))
    found = [
        _channel(spec, frame, TOPOGRAPHY, values, way) for way, values in sorted(recorded.items())
    ][::-1]
    known = set(STREAMS) <= recording.topics.keys()
    for name, lines in (_of_positions(recording, spec, frame) if known else {}).items():
        for way in ("trace", "retrace"):
            rows = [getattr(line, way) for line in lines]
            if not rows:
                raise InputError(f"{recording.path}: no line of the scan is whole: record it again")
            found.append(_channel(spec, frame, name, np.stack(rows), way))
    return tuple(found)


def _recorded_images(path: Path) -> dict[str, Array]:
    """Return heights (m) by direction, (lines, pixels) each, row 0 scanned first; none if none is.

    Raises InputError where several topics show one direction, and for images of other values.
    """
    last: dict[str, tuple[str, bytes]] = {}
    for run in (run for file in bag_files(path)[0] for run in runs(file)):
        way = way_of(run.topic)
        if run.type_name != IMAGE or way is None:
            continue
        if way in last and last[way][0] != run.topic:
            raise InputError(f"{path}: both {last[way][0]} and {run.topic}: record one scan a bag")
        last[way] = run.topic, run.cdrs[-1].tobytes()
    return {way: _heights(path, topic, cdr) for way, (topic, cdr) in last.items()}


def _heights(path: Path, topic: str, cdr: bytes) -> Array:
    try:
        return heights(decode(IMAGE, cdr))
    except ValueError as error:
        raise InputError(
            f"{path}: {topic}: no image of heights: {error}: record it again"
        ) from error


def _channel(spec: ScanSpec, frame: Frame, name: str, values: Array, way: str) -> ImageChannel:
    """Return a channel whose rows lie at the levels of y, in the middles of their pixels."""
    step = spec.range_y / (spec.lines - 1)
    return ImageChannel(
        name,
        "m",
        values,
        frame.right - frame.left,
        step * len(values),
        way,
        left=frame.left,
        bottom=spec.centre_y - 0.5 * (spec.range_y + step),
    )


def _of_positions(
    recording: ScanRecording, spec: ScanSpec, frame: Frame
) -> dict[str, list[ImageLine]]:
    """Return the lines of each error and each achieved position."""
    names = (*(f"Error {axis}" for axis in AXES), *(f"Achieved {axis}" for axis in AXES))
    imagers = {name: LineImager(spec, frame) for name in names}
    lines: dict[str, list[ImageLine]] = {name: [] for name in names}
    runs = (within(phases(spec).lines, run) for run in recording.blocks(*STREAMS))
    for desired, achieved in filter(None, runs):
        errors = (achieved.axis(axis) - desired.axis(axis) for axis in AXES)
        for name, values in zip(names, (*errors, achieved.x, achieved.y), strict=True):
            lines[name] += imagers[name].add(desired.x, values)
    return lines
