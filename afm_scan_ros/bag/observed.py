"""A bag as tracing sees it: what the scanner was driven with, and what it did."""

from afm_scan_ros.bag.reader import ScanRecording
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.errors import InputError

FEWEST = 1000
"""Samples, fewer than which tell nothing of an effect."""


def observed(recording: ScanRecording) -> Observation:
    """Read drive and displacement as far as both reach, of a scan or of any other record.

    Raises InputError where one is missing, where there are too few samples, or where they were
    taken at another instant than just before the converter's update, which the models assume.
    """
    info, path = recording.info, recording.path
    if info.sampling_instant != "before_update" or info.trigger_offset != 0.0:
        raise InputError(
            f"{path}: sampled {info.sampling_instant} with a trigger offset of"
            f" {info.trigger_offset:g} s; sample just before the converter's update"
        )
    drive, displacement = recording.together("drive_voltage", "achieved_displacement")
    if len(drive.x) < FEWEST:
        mend = "; ".join((f"record {FEWEST} or more", *recording.warnings))
        raise InputError(f"{path}: holds {len(drive.x)} samples of drive and displacement; {mend}")
    experiment = None if info.spec else info.pattern
    return Observation(str(path), drive, displacement, info.spec, experiment)
