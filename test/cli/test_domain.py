"""Each scan has a DDS domain to itself, unless the user has set one."""

import os
import socket

import pytest

from afm_scan_ros.cli.processes import isolate


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_DOMAIN_ID", "AFM_SCAN_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(name, "to be restored")
        monkeypatch.delenv(name)


def test_the_user_s_domain_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    isolate()
    assert os.environ["ROS_DOMAIN_ID"] == "42"


def test_a_domain_chosen_earlier_and_unset_since_is_chosen_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    isolate()
    monkeypatch.delenv("ROS_DOMAIN_ID")
    isolate()
    assert os.environ["ROS_DOMAIN_ID"] == os.environ["AFM_SCAN_DOMAIN_ID"]


def test_a_domain_that_another_took_meanwhile_is_left_to_it() -> None:
    isolate()
    first = os.environ["ROS_DOMAIN_ID"]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as another:
        another.bind(("127.0.0.1", 7410 + 250 * int(first)))
        isolate()
        assert os.environ["ROS_DOMAIN_ID"] != first
