"""What a node sets of its middleware, and what it says of the settings that a user brings."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import pytest
from attrs import frozen
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.files import share_directory
from afm_scan_ros.nodes import middleware
from afm_scan_ros.nodes.middleware import (
    CYCLONE,
    CYCLONE_SETTINGS,
    FAST_DDS,
    HEARTBEAT,
    KEPT,
    LOCAL,
    NEWER,
    PROFILES,
    SEGMENT,
    URI,
    lacking,
    lacks_room,
    prepare,
)

OURS = share_directory() / "config" / "fastdds.xml"
XMLNS = ' xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"'


@pytest.fixture(autouse=True)
def empty_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Leave this computer's shared memory and the current folder alone."""
    monkeypatch.setattr(middleware, "clear", list)
    monkeypatch.setattr(middleware, "lacks_room", list)
    monkeypatch.chdir(tmp_path)


@frozen
class Profile:
    """A user's profile; None is what it does not state."""

    segment: int | None
    heartbeat_ns: int | None
    kept: int | None
    default: str
    root: str

    def text(self) -> str:
        size = _tag("segment_size", self.segment)
        shm = f"<transport_id>m</transport_id><type>SHM</type>{size}"
        default = f'profile_name="mine" is_default_profile="{self.default}"'
        period = ""
        if self.heartbeat_ns is not None:
            seconds, rest = divmod(self.heartbeat_ns, 10**9)
            duration = f"<sec>{seconds}</sec><nanosec>{rest}</nanosec>"
            period = f"<times><heartbeatPeriod>{duration}</heartbeatPeriod></times>"
        limits = _tag("resourceLimitsQos", _tag("max_samples", self.kept))
        body = (
            f"<transport_descriptors><transport_descriptor>{shm}</transport_descriptor>"
            f"</transport_descriptors><participant {default}><rtps><userTransports>"
            "<transport_id>m</transport_id></userTransports></rtps></participant>"
            f"<data_writer {default}><topic>{limits}</topic>{period}</data_writer>"
        )
        inner = f"<profiles>{body}</profiles>" if self.root == "dds" else body
        return f"<{self.root}{XMLNS}>{inner}</{self.root}>"

    def lacks(self) -> set[str]:
        """Name the elements that do not suffice, by what Fast DDS takes where nothing is stated."""
        if self.default == "false":
            return {"userTransports", "data_writer"}
        kept = 5000 if self.kept is None else self.kept
        return {
            *({"segment_size"} if (self.segment or 0) < 32 * 1024**2 else ()),
            *({"heartbeatPeriod"} if self.heartbeat_ns is None or self.heartbeat_ns > 1e8 else ()),
            *({"max_samples"} if 0 < kept < 15_000 else ()),
        }


def _tag(name: str, value: Any) -> str:  # noqa: ANN401 - a number or text
    return "" if value is None else f"<{name}>{value}</{name}>"


PROFILE = st.builds(
    Profile,
    segment=st.none() | st.integers(0, 2**27) | st.sampled_from([SEGMENT - 1, SEGMENT]),
    heartbeat_ns=st.none() | st.integers(0, 4 * 10**9) | st.sampled_from([10**8, 10**8 + 1]),
    kept=st.none() | st.integers(-1, 40_000) | st.sampled_from([KEPT - 1, KEPT]),
    default=st.sampled_from(["true", "false", "1"]),
    root=st.sampled_from(["dds", "profiles"]),
)


@given(profile=PROFILE)
def test_each_thing_that_a_users_profile_lacks_is_named_once(profile: Profile) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "mine.xml")
        file.write_text(profile.text(), "utf-8")
        said = lacking(file, {})
    assert all(sentence.startswith(f"{file}: ") for sentence in said)
    names = (
        "segment_size is",
        "userTransports",
        "no data_writer",
        "heartbeatPeriod is",
        "max_samples is",
    )
    found = [name for sentence in said for name in names if name in sentence]
    words = {name.removesuffix(" is").removeprefix("no ") for name in found}
    assert len(found) == len(said)
    assert words == profile.lacks()


def test_our_own_profile_lacks_nothing() -> None:
    for reach in ("LOCALHOST", "SUBNET"):
        assert lacking(OURS, {"ROS_AUTOMATIC_DISCOVERY_RANGE": reach}) == []
    assert f"<segment_size>{SEGMENT}<" in OURS.read_text("utf-8")
    assert f"<max_samples>{KEPT}<" in OURS.read_text("utf-8")


@pytest.mark.parametrize("reach", ["SUBNET", "LOCALHOST"])
def test_a_profile_without_shared_memory_needs_no_segment_unless_ros_adds_one(
    tmp_path: Path, reach: str
) -> None:
    file = tmp_path / "udp.xml"
    text = OURS.read_text("utf-8").replace("<type>SHM</type>", "<type>UDPv4</type>")
    file.write_text(text, "utf-8")
    said = lacking(file, {"ROS_AUTOMATIC_DISCOVERY_RANGE": reach})
    assert ["userTransports" in sentence for sentence in said] == [True] * (reach == "LOCALHOST")


@given(content=st.binary(max_size=60))
def test_a_file_that_is_no_profile_is_named_with_the_consequence(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "broken.xml")
        file.write_bytes(content)
        said = lacking(file, {})
    assert said
    assert all(str(file) in sentence and "hold up the scan" in sentence for sentence in said)


def test_fast_dds_gets_our_profile_and_again_no_other() -> None:
    environment: dict[str, str] = {}
    for _ in range(2):
        assert prepare(environment) == []
        assert environment == {PROFILES: str(OURS)}


def test_a_users_profile_stays_and_is_checked(tmp_path: Path) -> None:
    missing = tmp_path / "missing.xml"
    environment = {PROFILES: str(missing), "RMW_IMPLEMENTATION": FAST_DDS}
    (sentence,) = prepare(environment)
    assert environment[PROFILES] == str(missing)
    assert str(missing) in sentence


def test_the_current_folders_profile_stays_unless_it_is_not_read(tmp_path: Path) -> None:
    local = tmp_path / LOCAL
    local.write_text("<dds><profiles/></dds>", "utf-8")
    environment: dict[str, str] = {}
    assert all(str(local) in sentence for sentence in prepare(environment))
    assert PROFILES not in environment
    skips = {"SKIP_DEFAULT_XML_FILE": "1"}
    assert prepare(skips) == []
    assert skips[PROFILES] == str(OURS)


def test_a_variable_that_jazzy_does_not_read_is_named() -> None:
    (sentence,) = prepare({NEWER: "mine.xml"})
    assert NEWER in sentence
    assert f"set {PROFILES}" in sentence


def test_memory_that_is_too_small_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Usage:
        free = SEGMENT

    monkeypatch.setattr(middleware.shutil, "disk_usage", lambda _: Usage)
    (sentence,) = lacks_room(tmp_path)
    assert str(tmp_path) in sentence
    assert lacks_room(tmp_path / "none") == []


@pytest.mark.parametrize("users", ["", "<CycloneDDS/>", "file:///none.xml"])
def test_cyclone_gets_our_settings_before_the_users(users: str) -> None:
    environment = {"RMW_IMPLEMENTATION": CYCLONE, URI: users}
    for _ in range(2):
        assert prepare(environment) == []
        assert environment[URI] == ",".join(filter(None, [CYCLONE_SETTINGS, users]))


def test_watermarks_of_the_user_are_named_wherever_they_stand(tmp_path: Path) -> None:
    file = tmp_path / "cyclone.xml"
    file.write_text("<CycloneDDS><Watermarks/></CycloneDDS>", "utf-8")
    for users in ("<Watermarks/>", str(file), f"file://{file}", f"<CycloneDDS/>,file://{file}"):
        (sentence,) = prepare({"RMW_IMPLEMENTATION": CYCLONE, URI: users})
        assert "Watermarks" in sentence


def test_another_middleware_is_said_not_to_have_been_tried() -> None:
    environment = {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}
    (sentence,) = prepare(environment)
    assert "rmw_zenoh_cpp was not tried" in sentence
    assert list(environment) == ["RMW_IMPLEMENTATION"]


STORE = """\
import os, subprocess, sys
from afm_scan_ros.nodes import middleware
middleware.prepare()
import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile
from std_msgs.msg import Empty
rclpy.init()
node, all_kept = rclpy.create_node("writer"), QoSProfile(history=HistoryPolicy.KEEP_ALL)
publisher = node.create_publisher(Empty, "messages", all_kept)
reader = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=subprocess.PIPE)
while not publisher.get_subscription_count():
    pass
sent = 0
try:
    while sent <= 25_000:
        publisher.publish(Empty())
        sent += 1
except rclpy._rclpy_pybind11.RCLError:
    pass
print(sent)
reader.kill()
"""
IDLE = """\
import sys, rclpy
from rclpy.qos import HistoryPolicy, QoSProfile
from std_msgs.msg import Empty
rclpy.init()
node = rclpy.create_node("reader")
node.create_subscription(Empty, "messages", print, QoSProfile(history=HistoryPolicy.KEEP_ALL))
sys.stdin.read()
"""


def test_fast_dds_keeps_as_many_messages_for_a_reader_that_hangs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It reads the profile: beside the 5000 that the reader takes, the writer has 15,000."""
    pytest.importorskip("rclpy")
    monkeypatch.setenv("RMW_IMPLEMENTATION", FAST_DDS)
    monkeypatch.delenv(PROFILES, raising=False)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", STORE, IDLE],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
        env=environment,
    )
    assert int(done.stdout) == KEPT + 5000


def test_the_limits_are_those_that_the_window_asks_for() -> None:
    """A lost block comes again within a quarter of the window of 20 blocks at 50 a second."""
    assert HEARTBEAT <= 20 / 50 / 4
