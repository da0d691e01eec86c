"""Writes a scan that was computed in one process, as the nodes' recorder would have written it."""

from pathlib import Path

from afm_scan_ros.bag.blocks import STREAMS, encode_block
from afm_scan_ros.bag.scan_info import TYPE as SCAN_INFO
from afm_scan_ros.bag.scan_info import ScanInfo, encode_info
from afm_scan_ros.bag.writer import BagWriter
from afm_scan_ros.core.align import end
from afm_scan_ros.core.types import Trace


class ScanWriter(BagWriter):
    """A bag with one scan. Raises InputError where the folder exists."""

    def __init__(self, folder: Path, info: ScanInfo) -> None:
        super().__init__(folder)
        self._info = info
        self.add_topic("/scan_info", SCAN_INFO, latched=True)
        for name, type_name in STREAMS.items():
            self.add_topic(f"/{name}", type_name)
        self.write("/scan_info", info.start, encode_info(info))
        self.flush()  # without it the rest would mean nothing

    def add(self, name: str, trace: Trace) -> None:
        """Append the next samples of a stream, as ``desired_displacement``."""
        last = end(trace) == self._info.total_samples
        cdr = encode_block(STREAMS[name], self._info, trace, last=last)
        self.write(f"/{name}", self._info.stamp(trace.first_sample), cdr)
