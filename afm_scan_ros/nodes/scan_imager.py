"""Node: publishes the image of a simulated sample, line by line.

The lines come from two streams of blocks, the desired and the achieved displacement.
"""

import time
from array import array
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.image_lines import Imaged, ImageLines, frame_of
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files.plant_file import load_sample
from afm_scan_ros.nodes.block_consumer import StreamReader, min_subscriptions, spec_of
from afm_scan_ros.nodes.messages import image_message
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, RETRACE_IMAGE, TRACE_IMAGE, NodeTopic
from afm_scan_ros.simulation.sample import Grating

MICRO, NANO = 1e-6, 1e-9


class ScanImager(StreamReader):
    """Reads a sample at the achieved position, and draws it where the tip was to be."""

    NAME = "scan_imager"
    PARAMETERS = (
        NodeParameter("sample_file", "", "Heights: .npy in m or a picture; none for a grating"),
        NodeParameter(
            "sample_width_um", 80.0, "Distance of the file's first and last column", low=0.0
        ),
        NodeParameter(
            "sample_height_nm", 100.0, "Height of white, and of the grating's bars", low=0.0
        ),
        NodeParameter("grating_pitch_um", 16.0, "Pitch of the grating", low=0.0),
        NodeParameter("grating_angle_deg", 25.0, "Angle of its bars to the y axis"),
        NodeParameter("pixels", 256, "Pixels in a line of the image", low=2),
        NodeParameter(
            "image_rate_hz", 4.0, "Largest number of images a second", low=0.1, high=10.0
        ),
        min_subscriptions(0),
    )

    def __init__(self) -> None:
        super().__init__()
        self._sample = self._load_sample()
        self._image_lines: ImageLines
        self._images = {topic: array("B") for topic in (TRACE_IMAGE, RETRACE_IMAGE)}
        self._columns = 0
        self._shown_at = 0.0
        for topic in self._images:
            self.write(topic, self.settings["min_subscriptions"])
        self.read([DESIRED, ACHIEVED])

    def prepare(self, info: ScanInfo) -> Iterator[str]:
        """Learn where the lines lie."""
        spec = spec_of(info)
        frame = frame_of(spec, self.settings["pixels"])
        self._image_lines = ImageLines(spec, frame, self._sample)
        self._columns = frame.pixels
        _check_room(spec.lines, frame.pixels)
        yield from ()

    def consume(self, topic: NodeTopic, block: Trace, *, last: bool) -> None:
        """Add the lines that a block makes whole; show them when it is time."""
        grown = False
        for line in self._image_lines.add(topic.name, block):
            for image, heights in zip(
                self._images.values(), (line.trace, line.retrace), strict=True
            ):
                image.frombytes(heights.astype("<f4").tobytes())
            grown = True
        due = time.monotonic() - self._shown_at >= 1.0 / self.settings["image_rate_hz"]
        if (last and self._images[TRACE_IMAGE]) or (due and grown):
            self._show()

    def _show(self) -> None:
        self._shown_at = time.monotonic()
        for topic, image in self._images.items():
            self.publish(topic, image_message(self.scan, image, self._columns, self.next_sample))

    def _load_sample(self) -> Imaged:
        given = self.settings
        white = NANO * given["sample_height_nm"]
        if given["sample_file"]:
            return load_sample(Path(given["sample_file"]), MICRO * given["sample_width_um"], white)
        try:
            angle = np.radians(given["grating_angle_deg"])
            return Grating(MICRO * given["grating_pitch_um"], white, angle)
        except ValueError as error:
            raise InputError(f"grating_pitch_um and sample_height_nm: {error}") from error


def _check_room(lines: int, pixels: int) -> None:
    try:
        np.empty((2, lines, pixels), np.float32)
    except (MemoryError, ValueError) as error:
        message = f"an image of {lines} lines does not fit in memory: give fewer pixels or lines"
        raise InputError(message) from error
