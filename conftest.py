"""No test sees the user's ROS domain, or what another test set; no test asserts time."""

import multiprocessing
import os
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from unittest import mock

import pytest
from hypothesis import HealthCheck, settings

# Test files run at once, and so do both axes of a diagnosis. Threads of BLAS would only wait for
# each other: a diagnosis would take several times the processor time. It is read when numpy is
# imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# How fast examples are made and run is the machine's, which may have other work. CI draws the same
# examples from the same tests, so that a change is judged by what it changed.
settings.register_profile(
    "any_machine",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize="CI" in os.environ,
)
# The same laws with other versions of numpy and scipy need fewer examples.
settings.register_profile("floor", parent=settings.get_profile("any_machine"), max_examples=10)
settings.load_profile("any_machine")


OF_THE_USER = (
    *("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"),
    *("CYCLONEDDS_URI", "AFM_SCAN_DOMAIN_ID"),
)
"""Variables that would join a test with the user's own nodes."""


WAITING = {"drivers", "nodes", "ros"}
"""Folders of tests that mostly wait for other processes."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the files that wait among those that compute: together they would leave cores idle.

    They come in the first four fifths, as the last file to end is waited for alone.
    """
    files = list(dict.fromkeys(item.path for item in items))
    place: dict[object, float] = {}
    for waits, share in ((True, 0.8), (False, 1.0)):
        group = [file for file in files if (file.parent.name in WAITING) == waits]
        place |= {file: share * index / len(group) for index, file in enumerate(group)}
    items.sort(key=lambda item: place[item.path])


@pytest.fixture(autouse=True)
def _environment() -> Iterator[None]:
    with mock.patch.dict(os.environ):
        for name in OF_THE_USER:
            os.environ.pop(name, None)
        yield


@pytest.fixture(autouse=True, scope="session")
def _forked_nodes() -> Iterator[None]:
    """Fork processes of nodes and drivers from one that has imported what they import."""
    if sys.platform != "linux" or find_spec("rclpy") or not find_spec("cyclonedds"):
        yield
        return
    from afm_scan_ros.cli import processes  # noqa: PLC0415 - slow to import
    from afm_scan_ros.drivers import client  # noqa: PLC0415 - as above
    from helpers import fork_server  # noqa: PLC0415 - of the tests' folder

    forking = fork_server.forking(fork_server.fork)
    with (
        mock.patch.object(processes, "subprocess", forking),
        mock.patch.object(client, "subprocess", forking),
    ):
        yield
    for process in multiprocessing.active_children():
        process.kill()  # or the tests' process would wait for it
