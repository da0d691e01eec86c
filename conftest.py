"""No test sees the user's ROS domain, or what another test set; no test asserts time."""

import os
from collections.abc import Iterator
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
    *("CYCLONEDDS_URI", "FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"),
    "AFM_SCAN_DOMAIN_ID",
)
"""Variables that would join a test with the user's own nodes."""


WAITING = {"drivers", "nidaqmx", "nodes"}
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
