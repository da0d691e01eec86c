"""What of a disturbed scan is in its bag, sample by sample the same as without the disturbance."""

from pathlib import Path

import numpy as np

from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.nodes.topics import BLOCKS


class Undisturbed:
    """The streams of a scan that nothing disturbed, for others to be held against."""

    def __init__(self, bag: Path) -> None:
        recording = read_scan(bag)
        self.sample_period = recording.info.sample_period
        self._streams = _streams(recording)
        self.total_samples = min(len(trace.x) for trace in self._streams.values())

    def kept(self, bag: Path) -> int:
        """Count the samples of a bag that it has of all streams.

        Raises InputError where one is missing before the end, comes twice, or is another.
        """
        streams = _streams(read_scan(bag))
        for name, trace in streams.items():
            for axis in AXES:
                samples = trace.axis(axis)
                if not np.array_equal(samples, self._streams[name].axis(axis)[: len(samples)]):
                    raise InputError(f"{bag}: {name}, {axis} is not as it was undisturbed")
        return min(len(trace.x) for trace in streams.values())

    def missing(self, bag: Path) -> str:
        """Say what is missing in a bag that should be whole; nothing if it is."""
        try:
            kept = self.kept(bag)
        except InputError as error:
            return str(error)
        lost = self.total_samples - kept
        return f"{bag}: {lost} samples are missing" if lost else ""


def _streams(recording: ScanRecording) -> dict[str, Trace]:
    return {
        name: recording.whole(name)
        if name in recording.topics
        else Trace(0, recording.info.sample_period, np.empty(0), np.empty(0))
        for name in BLOCKS
    }
