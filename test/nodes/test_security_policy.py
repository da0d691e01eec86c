"""The example of a policy allows each node its own topics and services, and no others."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from afm_scan_ros.files import share_directory
from afm_scan_ros.nodes import NODES
from afm_scan_ros.nodes.topics import (
    BLOCKS,
    DRIVE,
    MODEL_RESIDUAL,
    MONITOR,
    NODE_STATE,
    RETRACE_IMAGE,
    SCAN_INFO,
    TRACE_IMAGE,
    TRACKING_ERROR,
)

pytestmark = pytest.mark.long

CONFIG = share_directory() / "config"
POLICY = CONFIG / "sros2" / "policy.xml"
INCLUDE = "{http://www.w3.org/2001/XInclude}include"
SCAN = {
    *BLOCKS,
    *(topic.name for topic in (SCAN_INFO, NODE_STATE, TRACKING_ERROR, MODEL_RESIDUAL, MONITOR)),
    *(topic.name for topic in (TRACE_IMAGE, RETRACE_IMAGE)),
}
OF_ROS = {"/diagnostics", "/rosout", "/parameter_events", "~/transition_event"}
PATIENCE = 60.0
KINDS = {"publish": "topics", "subscribe": "topics", "reply": "services", "request": "services"}


def allowed(node: str, rule: str) -> set[str]:
    """Names that a node may use in a way."""
    root = ET.parse(POLICY).getroot()  # noqa: S314 - our own file
    profile = root.find(f".//profile[@node='{node}']")
    assert profile is not None
    lists: list[ET.Element] = []
    for each in profile:
        if each.tag == INCLUDE:
            lists += ET.parse(POLICY.with_name(each.attrib["href"])).getroot()  # noqa: S314 - too
        else:
            lists.append(each)
    found = [each for each in lists if each.tag == KINDS[rule] and each.get(rule) == "ALLOW"]
    return {(name.text or "").replace("~", f"/{node}") for each in found for name in each}


def test_each_node_has_an_enclave_and_names_topics_that_exist() -> None:
    root = ET.parse(POLICY).getroot()  # noqa: S314 - our own file
    paths = [enclave.attrib["path"] for enclave in root.iter("enclave")]
    assert paths == [f"/afm_scan/{name}" for name in (*NODES, "viewer")]
    for node in (*NODES, "viewer"):
        named = allowed(node, "publish") | allowed(node, "subscribe")
        assert named <= SCAN | {name.replace("~", f"/{node}") for name in OF_ROS}


def test_only_the_sources_of_a_drive_publish_one_and_viewers_read_no_blocks() -> None:
    drives = {node for node in NODES if DRIVE.name in allowed(node, "publish")}
    assert drives == {"excitation_generator", "inversion_compensator"}
    assert allowed("viewer", "subscribe").isdisjoint(BLOCKS)
    assert allowed("viewer", "publish").isdisjoint(SCAN)


OWN = {
    "scan_recorder": {"bag": "bag"},
    "scanner_driver": {
        "driver": "simulated",
        "settings_file": str(CONFIG / "simulated_scanner.yaml"),
    },
    "residual_monitor": {"model": str(CONFIG / "model.yaml")},
    "excitation_generator": {"kind": "hysteresis"},
    "inversion_compensator": {"line_feedback": True, "model": str(CONFIG / "model.yaml")},
}
START = "import sys; from afm_scan_ros.nodes import start; sys.exit(start('{}'))"


@pytest.mark.parametrize("node", NODES)
def test_what_a_node_uses_on_ros_is_allowed(node: str, tmp_path: Path) -> None:
    rclpy = pytest.importorskip("rclpy")
    pairs = [f"{name}:={json.dumps(value)}" for name, value in OWN.get(node, {}).items()]
    given = [word for pair in pairs for word in ("-p", pair)]
    command = [sys.executable, "-c", START.format(node), "--ros-args", *given]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    rclpy.init(args=[])
    probe = rclpy.create_node("probe")
    with subprocess.Popen(command, cwd=tmp_path, env=environment) as process:
        try:
            used = _used(probe, node, process)
        finally:
            process.kill()
            probe.destroy_node()
            rclpy.shutdown()
    assert len(used["publish"]) > 2
    for rule, names in used.items():
        assert names <= {name if name[0] == "/" else f"/{name}" for name in allowed(node, rule)}


def _used(probe: object, node: str, process: "subprocess.Popen[bytes]") -> dict[str, set[str]]:
    """Return what a node publishes, reads and answers, once it hears the other nodes.

    It makes its reader of node_state last.
    """
    ways = {"publish": "publisher", "subscribe": "subscriber", "reply": "service"}
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.1)
        if (node, "/") not in probe.get_node_names_and_namespaces():  # type: ignore[attr-defined]
            continue
        found = {
            rule: {
                name for name, _ in getattr(probe, f"get_{way}_names_and_types_by_node")(node, "/")
            }
            for rule, way in ways.items()
        }
        if f"/{NODE_STATE.name}" in found["subscribe"]:
            return found
    raise AssertionError(f"{node} did not come up")
