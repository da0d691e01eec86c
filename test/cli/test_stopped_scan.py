"""A scan that was stopped on request has no failed node, and yet is incomplete."""

import pytest

from afm_scan_ros.cli.processes import Ended, raise_failure
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.parameters import STOPPED


def test_a_stopped_scan_is_incomplete_to_the_command() -> None:
    said = f"trajectory_generator: done: {STOPPED} at sample 5"
    ended = [Ended("trajectory_generator", 0, said), Ended("scan_recorder", 0, "")]
    with pytest.raises(ScanError, match=f"^{said}$"):
        raise_failure(ended, [each.name for each in ended])
