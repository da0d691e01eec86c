"""The imager as a process among others: its images grow, are latched, and show the sample."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.node import Node

from afm_scan_ros.cli.processes import NodeProcess
from afm_scan_ros.core.image_lines import frame_of
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.topics import RETRACE_IMAGE, TRACE_IMAGE
from helpers.ros import PATIENCE, joined, until

pytestmark = pytest.mark.long

PIXELS = 100
CONSUMERS = ("inversion_compensator", "piezoscanner_sim", "scan_imager")
SPEC = ScanSpec(range_x=10e-6, range_y=10e-6, line_rate=20.0, lines=6, samples_per_line=1000)

Start = Callable[..., NodeProcess]


class Viewer(Node):
    """Keeps every image that is shown."""

    def __init__(self) -> None:
        super().__init__("viewer")
        self.images: dict[str, list[NDArray[np.float32]]] = {}
        for topic in (TRACE_IMAGE, RETRACE_IMAGE):
            kept = self.images.setdefault(topic.name, [])
            self.create_subscription(
                topic.kind, topic.name, lambda m, kept=kept: kept.append(pixels(m)), topic.reader
            )


def pixels(message: Message) -> NDArray[np.float32]:
    assert (message.encoding, message.is_bigendian) == ("32FC1", 0)
    assert message.header.frame_id == "scanner"
    assert message.step == 4 * message.width
    data = np.frombuffer(bytes(message.data), np.float32)
    return data.reshape(message.height, message.width)


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    with joined():
        made = Viewer()
        yield made
        made.destroy_node()


@pytest.fixture
def sample(tmp_path: Path) -> Path:
    """Return the file of a ramp: 1 nm up for each µm of x, 10 nm for each µm of y."""
    place = np.linspace(-10.0, 10.0, 41)
    np.save(tmp_path / "ramp.npy", 1e-9 * (place[None, :] + 10.0 * place[:, None]))
    return tmp_path / "ramp.npy"


def test_images_grow_line_by_line(start: Start, spec: Path, sample: Path, viewer: Viewer) -> None:
    nodes = [
        start(
            "scan_imager",
            sample_file=str(sample),
            sample_width_um=20.0,
            pixels=PIXELS,
            image_rate_hz=10.0,
            min_subscriptions=1,
        ),
        start("piezoscanner_sim", min_true_subscriptions=0),
        start("inversion_compensator", min_subscriptions=1),
        start("trajectory_generator", spec, required_nodes=list(CONSUMERS)),
    ]
    until(lambda: all(node.process.poll() is not None for node in nodes), viewer)
    assert [node.last_words() for node in nodes if node.process.returncode] == []
    for images in viewer.images.values():
        heights = [len(image) for image in images]
        assert heights == sorted(heights)
        assert len(images) > 1
        y, x = np.linspace(-5.0, 5.0, SPEC.lines), 1e6 * frame_of(SPEC, PIXELS).centres
        shown, expected = images[-1], 1e-9 * (x[None, :] + 10.0 * y[:, None])
        assert shown.shape == (SPEC.lines, PIXELS)
        inner = slice(10, -10)  # the y step and the turn-around lie at the ends of retraces
        rms = np.sqrt(np.mean((shown - expected)[1:, inner] ** 2))
        assert rms < (1.5e-9 if images is viewer.images[TRACE_IMAGE.name] else 20e-9)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"sample_file": "nowhere.png"}, "nowhere.png: no such file"),
        ({"grating_pitch_um": 0.0}, "grating_pitch_um and sample_height_nm"),
        ({"pixels": 1}, "parameter pixels"),
    ],
)
def test_what_cannot_be_imaged_is_refused_at_once(
    start: Start, parameters: dict[str, object], says: str
) -> None:
    node = start("scan_imager", **parameters)
    assert node.process.wait(PATIENCE) == 2
    assert says in node.last_words()
