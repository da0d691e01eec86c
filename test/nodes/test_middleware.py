"""What a node sets of its middleware, and what it says of the settings that a user brings."""

import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest
from attrs import frozen
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.files import share_directory
from afm_scan_ros.nodes import middleware
from afm_scan_ros.nodes.middleware import (
    COMPUTER,
    CYCLONE,
    CYCLONE_SETTINGS,
    FAST_DDS,
    HEARTBEAT,
    KEPT,
    LOCAL,
    NETWORK,
    NEWER,
    PEERS,
    PROFILES,
    RANGE,
    SEGMENT,
    UDP_ALONE,
    URI,
    in_flight,
    lacking,
    lacks_room,
    prepare,
    sockets_hold,
)
from afm_scan_ros.nodes.scan_node import COMMON

OURS = share_directory() / "config" / "fastdds.xml"
XMLNS = ' xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"'


@pytest.fixture(autouse=True)
def empty_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Leave this computer's shared memory, sockets and the current folder alone."""
    monkeypatch.setattr(middleware, "sockets_hold", lambda _: False)
    monkeypatch.setattr(middleware, "clear", list)
    monkeypatch.setattr(middleware, "lacks_room", list)
    monkeypatch.chdir(tmp_path)


@frozen
class Profile:
    """A user's profile; None is what it does not state."""

    segment: int | None
    check_ms: int | None
    heartbeat_ns: int | None
    pause_ns: int | None
    kept: int | None
    default: str
    root: str

    def text(self) -> str:
        size = _tag("segment_size", self.segment)
        size += _tag("healthy_check_timeout_ms", self.check_ms)
        shm = f"<transport_id>m</transport_id><type>SHM</type>{size}"
        default = f'profile_name="mine" is_default_profile="{self.default}"'
        period = _duration("heartbeatPeriod", self.heartbeat_ns)
        times = _tag("times", period + _duration("nackSupressionDuration", self.pause_ns))
        limits = _tag("resourceLimitsQos", _tag("max_samples", self.kept))
        body = (
            f"<transport_descriptors><transport_descriptor>{shm}</transport_descriptor>"
            f"</transport_descriptors><participant {default}><rtps><userTransports>"
            "<transport_id>m</transport_id></userTransports></rtps></participant>"
            f"<data_writer {default}><topic>{limits}</topic>{times}</data_writer>"
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
            *({"healthy_check_timeout_ms"} if self.check_ms is None or self.check_ms > 150 else ()),
            *({"heartbeatPeriod"} if self.heartbeat_ns is None or self.heartbeat_ns > 1e8 else ()),
            *({"nackSupressionDuration"} if (self.pause_ns or 0) < 1e8 else ()),
            *({"max_samples"} if 0 < kept < 15_000 else ()),
        }


def _tag(name: str, value: Any) -> str:  # noqa: ANN401 - a number or text
    return "" if value is None else f"<{name}>{value}</{name}>"


def _duration(name: str, nanoseconds: int | None) -> str:
    if nanoseconds is None:
        return ""
    seconds, rest = divmod(nanoseconds, 10**9)
    return _tag(name, f"<sec>{seconds}</sec><nanosec>{rest}</nanosec>")


NANOSECONDS = st.none() | st.integers(0, 4 * 10**9) | st.sampled_from([10**8 - 1, 10**8, 10**8 + 1])
PROFILE = st.builds(
    Profile,
    segment=st.none() | st.integers(0, 2**27) | st.sampled_from([SEGMENT - 1, SEGMENT]),
    check_ms=st.none() | st.integers(0, 2000) | st.sampled_from([150, 151]),
    heartbeat_ns=NANOSECONDS,
    pause_ns=NANOSECONDS,
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
    words = ["segment_size is", "userTransports", "no data_writer", "heartbeatPeriod is"]
    words += ["nackSupressionDuration is", "max_samples is", "healthy_check_timeout_ms is"]
    found = [word for sentence in said for word in words if word in sentence]
    assert len(found) == len(said)
    assert {word.removesuffix(" is").removeprefix("no ") for word in found} == profile.lacks()


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


@pytest.mark.parametrize("viewing", [False, True])
@pytest.mark.parametrize(
    ("asked", "name", "reach"),
    [
        ({}, NETWORK, None),
        ({RANGE: "SUBNET", PEERS: "10.0.0.2"}, NETWORK, "SUBNET"),
        ({RANGE: "LOCALHOST"}, COMPUTER, "SYSTEM_DEFAULT"),
    ],
)
def test_no_queue_in_shared_memory_where_sockets_hold_what_is_in_flight(
    monkeypatch: pytest.MonkeyPatch,
    asked: dict[str, str],
    name: str,
    reach: str | None,
    *,
    viewing: bool,
) -> None:
    monkeypatch.setattr(middleware, "sockets_hold", lambda size: viewing or size <= 4 * 2**20)
    environment = dict(asked)
    for _ in range(2):  # a process that a node's process starts finds what that one has set
        assert prepare(environment, viewing=viewing) == []
        assert environment == asked | {PROFILES: str(OURS.with_name(name))} | (
            {RANGE: reach} if reach else {}
        )


@pytest.mark.parametrize(
    "asked", [{RANGE: "LOCALHOST", PEERS: "10.0.0.2"}, {"ROS_LOCALHOST_ONLY": "1"}]
)
def test_ros_keeps_a_reach_that_a_profile_cannot_give(
    monkeypatch: pytest.MonkeyPatch, asked: dict[str, str]
) -> None:
    monkeypatch.setattr(middleware, "sockets_hold", lambda _: True)
    environment = dict(asked)
    assert prepare(environment) == []
    assert environment == asked | {PROFILES: str(OURS)}


def test_what_a_socket_holds_is_the_systems_to_say() -> None:
    least = int(Path("/proc/sys/net/core/rmem_max").read_text("ascii"))
    assert sockets_hold(least)
    assert not sockets_hold(2 * least + 2)


@pytest.mark.parametrize("name", UDP_ALONE)
def test_profiles_without_shared_memory_give_what_a_scan_needs(name: str) -> None:
    file = OURS.with_name(name)
    tree = ET.parse(file)  # noqa: S314 - our own file
    assert [element.text for element in tree.iterfind(".//{*}type")] == ["UDPv4"]
    assert lacking(file, {RANGE: "SYSTEM_DEFAULT"}) == []
    sizes = [int(size.text or 0) for size in tree.iterfind(".//{*}receiveBufferSize")]
    assert sizes == [in_flight()]


def test_all_profiles_let_a_writer_keep_and_repeat_the_same() -> None:
    """Fast DDS reads one file, so that each has to state it all."""
    files = [OURS, *(OURS.with_name(name) for name in UDP_ALONE)]
    trees = [ET.parse(file) for file in files]  # noqa: S314 - our own files
    for path in (".//{*}data_writer", ".//{*}leaseAnnouncement"):
        stated = [
            [(each.tag, (each.text or "").strip()) for each in element.iter()]
            for element in map(itemgetter(0), (tree.findall(path) for tree in trees))
        ]
        assert stated[0] == stated[1] == stated[2]


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


JOIN = """\
from afm_scan_ros.nodes import middleware
middleware.sockets_hold = lambda size: {}
middleware.prepare()
import rclpy
rclpy.init()
node = rclpy.create_node("joined")
mapped = [line for line in open("/proc/self/maps") if "/dev/shm/fastrtps_" in line]
ends = [[int(end, 16) for end in line.split()[0].split("-")] for line in mapped]
print(max((last - first for first, last in ends), default=0))
"""


@pytest.mark.parametrize(("reach", "holds"), [("LOCALHOST", True), ("SUBNET", True), ("", False)])
def test_fast_dds_reads_the_profile(
    monkeypatch: pytest.MonkeyPatch, reach: str, *, holds: bool
) -> None:
    """It takes all of a file or nothing; the size of the shared memory tells."""
    pytest.importorskip("rclpy")
    monkeypatch.delenv("RMW_IMPLEMENTATION", raising=False)
    monkeypatch.delenv(PROFILES, raising=False)
    monkeypatch.setenv(RANGE, reach)
    path = os.pathsep.join(map(os.path.abspath, sys.path))  # seen from this test's folder
    done = subprocess.run(
        [sys.executable, "-c", JOIN.format(holds)],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert int(done.stdout) == 0 if holds else int(done.stdout) >= SEGMENT


def test_the_limits_are_those_that_the_window_asks_for() -> None:
    """A lost block comes again within a quarter of the window of 20 blocks at 50 a second."""
    assert HEARTBEAT <= 20 / 50 / 4


def test_an_older_node_is_found_before_a_silence_counts() -> None:
    """Its answer to a new node's first announcement may come before that one listens."""
    announced = ET.parse(OURS).find(".//{*}leaseAnnouncement")  # noqa: S314 - our own file
    assert announced is not None
    seconds, more = (float(announced.findtext(f"{{*}}{name}", "0")) for name in ("sec", "nanosec"))
    (silence,) = (each.default for each in COMMON if each.name == "liveness_timeout_s")
    assert 0.0 < seconds + 1e-9 * more < silence
