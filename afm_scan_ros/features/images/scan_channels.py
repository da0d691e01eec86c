"""A recorded scan as channels of images, at the desired positions: heights, positions, errors."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from afm_scan_ros.bag.folder import bag_files
from afm_scan_ros.bag.mcap_file import runs
from afm_scan_ros.bag.monitored import IMAGE, heights, way_of
from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.bag.typestore import decode
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.image_lines import Frame, ImageLine, LineImager, frame_of, most_pixels
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import within
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.features.images.files.channels import ImageChannel

PIXELS = 256
STREAMS = ("desired_displacement", "achieved_displacement")
"""What images of errors and positions need."""
TOPOGRAPHY = "Topography"


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
    for run in (run for file in bag_files(path).files for run in runs(file)):
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
        bottom=-0.5 * (spec.range_y + step),
    )


def _of_positions(
    recording: ScanRecording, spec: ScanSpec, frame: Frame
) -> dict[str, list[ImageLine]]:
    """Return the lines of each error and each achieved position."""
    names = (*(f"Error {axis}" for axis in AXES), *(f"Achieved {axis}" for axis in AXES))
    imagers = {name: LineImager(spec, frame) for name in names}
    lines: dict[str, list[ImageLine]] = {name: [] for name in names}
    for desired, achieved in _lines(recording, spec):
        errors = (achieved.axis(axis) - desired.axis(axis) for axis in AXES)
        for name, values in zip(names, (*errors, achieved.x, achieved.y), strict=True):
            lines[name] += imagers[name].add(desired.x, values)
    return lines


def _lines(recording: ScanRecording, spec: ScanSpec) -> Iterator[tuple[Trace, ...]]:
    """Return runs of desired and achieved displacement, those of the lines alone."""
    return filter(None, (within(phases(spec).lines, run) for run in recording.blocks(*STREAMS)))
