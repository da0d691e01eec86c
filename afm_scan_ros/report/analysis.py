"""Desired against achieved displacement: all figures of a recorded scan or other record."""

from collections.abc import Iterator
from math import isclose
from pathlib import Path
from typing import TypeAlias

import numpy as np
from attrs import field, frozen

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import METRES, AxisError, Tracking, TrackingMeter, sensor_doubt
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.report.sentences import sentence

OTHER_RANGE = 0.05
"""Share by which the desired range may differ from what is stated: samples miss the very turns."""
VOLTS = {"unit": "v"}


@frozen
class DriveRange:
    """Lowest and highest drive voltage of each axis over the whole scan, preparation included."""

    lowest_x: float = field(metadata=VOLTS)
    highest_x: float = field(metadata=VOLTS)
    lowest_y: float = field(metadata=VOLTS)
    highest_y: float = field(metadata=VOLTS)


@frozen
class Analysis:
    """The figures of a scan; ``true`` only where a simulator recorded it without noise.

    ``shortcomings`` are sentences on what is missing: the scan is complete where there are none.
    """

    bag: str
    scan: ScanInfo
    measured: Tracking
    true: Tracking | None
    drive: DriveRange | None
    warnings: tuple[str, ...]
    shortcomings: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the bag's folder or file."""
        return Path(self.bag).absolute().name


def scan_spec(recording: ScanRecording) -> ScanSpec:
    """Return what the scan was to be; raises InputError for a record that is not a scan."""
    spec = recording.info.spec
    if not recording.stated:
        raise InputError(sentence("analysis.no_scan_info", path=recording.path))
    if spec is None:
        kind = recording.info.pattern
        raise InputError(sentence("analysis.no_scan", path=recording.path, kind=kind))
    return spec


def analyse(recording: ScanRecording) -> Analysis:
    """Compare a recorded scan's displacement with the desired one, in memory for one line.

    Raises InputError where the bag holds no scan, or one with a gap, a repeat or a NaN.
    """
    spec = scan_spec(recording)
    meters = {ACHIEVED: TrackingMeter(spec, "measured")}
    if "true_displacement" in recording.topics:
        meters["true_displacement"] = TrackingMeter(spec, "true")
    ends = []
    for desired, *achieved in recording.blocks(DESIRED, *meters):
        if desired.x.size:
            ends.append(_ends(achieved[0]))
        for meter, trace in zip(meters.values(), achieved, strict=True):
            meter.add(desired, trace)
    measured = meters[ACHIEVED].tracking()
    true = meters.get("true_displacement")
    total = recording.info.total_samples
    counts = {"samples": measured.samples, "total": total}
    incomplete = sentence("analysis.incomplete", path=recording.path, **counts)
    return Analysis(
        bag=str(recording.path),
        scan=recording.info,
        measured=measured,
        true=true.tracking() if true else None,
        drive=_drive_range(recording),
        warnings=(*recording.warnings, *_doubts(recording, measured, ends)),
        shortcomings=() if measured.samples == total else (incomplete,),
    )


Ends: TypeAlias = list[tuple[float, float]]
"""Lowest and highest value of each axis."""


def _ends(trace: Trace) -> Ends:
    return [(float(v.min()), float(v.max())) for v in (trace.x, trace.y)]


def _doubts(recording: ScanRecording, measured: Tracking, ends: list[Ends]) -> Iterator[str]:
    """Say what is dubious in the sensors, and where the samples are not those of scan_info."""
    complete = measured.lines == scan_spec(recording).lines
    for number, axis in enumerate(AXES if ends else ()):
        error: AxisError = getattr(measured, axis)
        moved, planned = error.peak_to_peak, error.planned_range
        lowest, highest = np.array([each[number] for each in ends]).T
        if doubt := sensor_doubt(axis, moved, lowest.min(), highest.max()):
            yield f"{recording.path}: {doubt}"
        if complete and not isclose(moved, planned, rel_tol=OTHER_RANGE):
            ranges = {"planned": planned, "moved": moved}
            yield sentence("analysis.other_range", path=recording.path, axis=axis, **ranges)


def _drive_range(recording: ScanRecording) -> DriveRange | None:
    if "drive_voltage" not in recording.topics:
        return None
    blocks = recording.blocks("drive_voltage")
    ends = [_ends(drive) for (drive,) in blocks if drive.x.size]
    if not ends:
        return None
    lowest, highest = np.min(ends, axis=0)[:, 0].tolist(), np.max(ends, axis=0)[:, 1].tolist()
    return DriveRange(lowest[0], highest[0], lowest[1], highest[1])


@frozen
class AxisComparison:
    """Achieved minus desired of one axis over a whole record, nothing fitted.

    ``mean`` is the part of ``rms`` that a sensor's arbitrary zero makes, ``spread`` the rest.
    """

    peak_to_peak: float = field(metadata=METRES)
    rms: float = field(metadata=METRES)
    largest: float = field(metadata=METRES)
    mean: float = field(metadata=METRES)
    spread: float = field(metadata=METRES)


@frozen
class Comparison:
    """The figures of a record; None for an axis that was not measured."""

    bag: str
    record: str
    samples: int
    x: AxisComparison | None
    y: AxisComparison | None
    warnings: tuple[str, ...]


def comparable(recording: ScanRecording) -> bool:
    """Whether a recording is no scan, yet has both displacements."""
    return recording.info.spec is None and {DESIRED, ACHIEVED} <= recording.topics.keys()


def compare(recording: ScanRecording) -> Comparison:
    """Compare a record's displacements. Raises InputError for gaps, and where it is cut short."""
    desired, achieved = recording.together(DESIRED, ACHIEVED)
    samples = desired.x.size
    missing = recording.missing(samples)
    if missing:
        fix = "; ".join((*recording.warnings, "import again"))
        raise InputError(f"{recording.path}: the last {missing} samples are missing; {fix}")
    x, y = (_compare(desired.axis(axis), achieved.axis(axis)) for axis in AXES)
    info = recording.info
    return Comparison(str(recording.path), info.pattern, samples, x, y, recording.warnings)


def _compare(desired: Array, achieved: Array) -> AxisComparison | None:
    if not (desired.any() or achieved.any()):
        return None
    error = achieved - desired
    return AxisComparison(
        peak_to_peak=float(np.ptp(desired)),
        rms=float(np.sqrt(np.mean(error**2))),
        largest=float(np.abs(error).max()),
        mean=float(error.mean()),
        spread=float(error.std()),
    )
