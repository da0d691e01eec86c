"""A process of range LOCALHOST takes no packet of another host, and listens in its domain alone."""

import json
import os
import subprocess
import sys

import pytest

from afm_scan_ros.ros.cyclone.domain import stays_here

DOMAIN = 90
OPENED = """\
import json, os, socket
from afm_scan_ros import ros
ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
node = ros.Node("tested")
found = []
for descriptor in map(int, os.listdir("/proc/self/fd")):
    try:
        opened = socket.socket(fileno=os.dup(descriptor))
    except OSError:
        continue
    if opened.family in (socket.AF_INET, socket.AF_INET6):
        device = opened.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16)
        found.append([opened.type, device.rstrip(b"\\0").decode(), *opened.getsockname()])
print(json.dumps(found))
"""


def opened(reach: str) -> list[list[object]]:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)}
    environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = reach
    done = subprocess.run(
        [sys.executable, "-c", OPENED], env=environment, check=True, capture_output=True
    )
    return json.loads(done.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="no other system binds to a device")
@pytest.mark.parametrize("reach", ["LOCALHOST", "OFF"])
def test_every_socket_is_of_the_loopback_and_its_domain(reach: str) -> None:
    found = opened(reach)
    assert found
    assert {device for _, device, *_ in found} == {"lo"}
    assert {kind for kind, *_ in found} == {2}  # datagrams: nothing listens for connections
    everywhere = [port for _, _, address, port in found if address == "0.0.0.0"]  # noqa: S104 - looked for
    if reach == "LOCALHOST":
        assert everywhere
        assert set(everywhere) <= set(range(7400 + 250 * DOMAIN, 7400 + 250 * (DOMAIN + 1)))


def test_what_a_user_asks_of_the_middleware_is_left_alone() -> None:
    assert stays_here({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert not stays_here({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"})
    assert not stays_here({})
    other = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": "<CycloneDDS/>"}
    assert not stays_here(other)
