"""The settings of a node's writers: no viewer that was stopped blocks them."""

import signal
import subprocess
from collections.abc import Callable

from afm_scan_ros.ros.common import NODE_SETTINGS, URI, use_node_settings, users_settings

BLOCKS = 3000
"""48 MB: more than Cyclone DDS keeps by itself, a hundred times."""


def test_a_stopped_viewer_blocks_no_node(start: Callable[..., subprocess.Popen[str]]) -> None:
    """A writer that blocks is released when the viewer has ceased to be a reader."""
    viewer, node = start("read"), start("outrun", str(BLOCKS))
    assert node.stdin is not None
    assert node.stdout is not None
    assert node.stdout.readline() == "begins\n"
    viewer.send_signal(signal.SIGSTOP)
    node.stdin.write("go on\n")
    node.stdin.flush()
    assert node.stdout.readline() == "1\n"


def test_what_the_user_wrote_stands_last_and_is_known() -> None:
    environment = {URI: "<CycloneDDS/>"}
    for _ in range(2):
        use_node_settings(environment)
        assert environment[URI] == f"{NODE_SETTINGS},<CycloneDDS/>"
        assert users_settings(environment) == "<CycloneDDS/>"


def test_where_the_user_wrote_nothing_the_settings_stand_alone() -> None:
    environment: dict[str, str] = {}
    for _ in range(2):
        use_node_settings(environment)
        assert environment == {URI: NODE_SETTINGS}
        assert not users_settings(environment)
