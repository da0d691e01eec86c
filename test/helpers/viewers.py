"""What viewers show: the topic of single samples, and the curves of the layouts."""

import json
from math import isnan
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbags.interfaces import Nodetype

from afm_scan_ros.bag.mcap_file import messages
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.typestore import decode, stamp_of, typestore
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.core.types import AXES

LAYOUTS = CONFIG / "layouts"
STREAMS = {
    "desired": "desired_displacement",
    "achieved": "achieved_displacement",
    "drive": "drive_voltage",
}
NUMBERS = {"float64", "float32", "uint64", "uint32", "int64", "int32"}


def assert_curves_are_recorded(bag: Path) -> None:
    """Every topic that a layout names is in a bag, and every field of it is a number."""
    (file,) = bag.glob("*.mcap")
    types = {message.topic: message.type_name for message in messages(file)}
    for topic, field in (*_of_plotjuggler(), *_of_foxglove()):
        kinds = dict(typestore().fielddefs[types[topic]][1])
        assert kinds[field][0] == Nodetype.BASE
        assert kinds[field][1][0] in NUMBERS


def assert_samples_are_of_the_streams(bag: Path, step: int) -> None:
    """Each sample for viewers is one of the blocks, and its number a multiple of the step."""
    (file,) = bag.glob("*.mcap")
    recording = read_scan(bag)
    streams = {name: recording.whole(stream) for name, stream in STREAMS.items()}
    samples = [decode(m.type_name, m.cdr) for m in messages(file) if m.topic == "/monitor"]
    numbers = [each.sample for each in samples]
    assert numbers == [number for number in sorted({*numbers}) if number % step == 0]
    assert any(not isnan(each.drive_x) for each in samples)
    for each in samples:
        assert each.scan_id == recording.info.scan_id
        assert stamp_of(each) == recording.info.stamp(each.sample)
        for axis in AXES:
            shown = {name: getattr(each, f"{name}_{axis}") for name in STREAMS}
            true = {name: trace.axis(axis)[each.sample] for name, trace in streams.items()}
            if isnan(shown["drive"]):
                del shown["drive"], true["drive"]
            assert shown == true
            error = getattr(each, f"error_{axis}")
            assert error == true["achieved"] - true["desired"]


def _of_plotjuggler() -> list[tuple[str, str]]:
    """Topics and fields, which PlotJuggler joins by slashes."""
    root = ET.parse(LAYOUTS / "plotjuggler.xml").getroot()  # noqa: S314 - our own file
    names = [curve.attrib["name"] for curve in root.iter("curve")]
    return [(topic, field) for topic, _, field in (name.rpartition("/") for name in names)]


def _of_foxglove() -> list[tuple[str, str]]:
    """Topics and fields, which Foxglove joins by a dot."""
    layout = json.loads((LAYOUTS / "foxglove.json").read_text("utf-8"))
    values = [path["value"] for panel in layout["configById"].values() for path in panel["paths"]]
    return [(topic, field) for topic, _, field in (value.partition(".") for value in values)]
