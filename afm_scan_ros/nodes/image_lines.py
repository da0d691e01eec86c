"""Lines of an image from two streams of blocks: where the tip should be, and where it is."""

from collections.abc import Iterator

from afm_scan_ros.core.align import Aligner, end, part
from afm_scan_ros.core.imaging.lines import Frame, ImageLine, LineImager
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.sample import Sample


class ImageLines:
    """Reads a sample's height at the achieved position and places it at the desired one.

    The tip touches the sample on the lines alone.
    """

    def __init__(self, spec: ScanSpec, frame: Frame, sample: Sample) -> None:
        self._sample = sample
        self._where = phases(spec).lines
        self._imager = LineImager(spec, frame)
        self._aligner = Aligner(("desired_displacement", "achieved_displacement"))

    def add(self, name: str, block: Trace) -> Iterator[ImageLine]:
        """Take a block of one of the two topics; yield the lines that it makes whole."""
        self._aligner.add(name, block)
        for run in self._aligner.ready():
            start = max(self._where.start, run[0].first_sample)
            stop = min(self._where.stop, end(run[0]))
            if start < stop:
                desired, achieved = (part(trace, start, stop) for trace in run)
                heights = self._sample.height(achieved.x, achieved.y)
                yield from self._imager.add(desired.x, heights)
