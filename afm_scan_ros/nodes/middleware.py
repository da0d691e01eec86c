"""Prepares ROS's middleware before a node joins: settings with which no viewer can hold up a scan.

What a user has set prevails. It is checked for what a scan needs.
"""

import os
import shutil
import socket
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, MutableMapping
from pathlib import Path

from afm_scan_ros.files import share_directory
from afm_scan_ros.nodes.shared_memory import MEMORY, clear

FAST_DDS, CYCLONE = "rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"


def prepare(
    environment: MutableMapping[str, str] = os.environ, *, viewing: bool = False
) -> list[str]:
    """Set the middleware up and clear what dead processes left; return warnings, a sentence each.

    Fast DDS gets no shared memory where sockets hold what a scan has in flight, nor for who is only
    ``viewing``: with it, Fast DDS at times waits 2 s to send to a process that was stopped.

    Call it before ``rclpy.init``, and write the warnings before it too: a file in shared memory
    that could not be removed may hang it. Raises FileNotFoundError for a broken installation.
    """
    name = environment.get("RMW_IMPLEMENTATION") or FAST_DDS
    if name == CYCLONE:
        return _prepare_cyclone(environment)
    if name == FAST_DDS:
        said = [*_prepare_fast_dds(environment, viewing=viewing), *clear()]
        return (
            said if Path(environment.get(PROFILES, "")).name in UDP_ALONE else said + lacks_room()
        )
    tried = f"{FAST_DDS} and {CYCLONE} were"
    return [f"RMW_IMPLEMENTATION={name} was not tried with this package; {tried}"]


URI = "CYCLONEDDS_URI"

# A writer blocks above the high mark, half a megabyte by itself. A reader whose process was stopped
# or killed is a reader until its lease ends, 10 s. At 2 MHz, more than a chain of nodes can pass
# on, 16 bytes a sample make 320 MB in 10 s; twice that is kept. Memory is taken when it is needed.
# Readers are asked for what they lack with a message that comes 4/5 of the heartbeat's interval,
# 100 ms by itself, after the one before.
_KEPT = (
    "<HeartbeatInterval>6 ms</HeartbeatInterval><Watermarks><WhcHigh>640 MB</WhcHigh>"
    "<WhcHighInit>640 MB</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks>"
)
# What comes while a process's receiving thread waits for a core has to fit in here, or is lost and
# sent again when asked for; 1 MB by itself. A system may allow less.
_ROOM = '<SocketReceiveBufferSize max="4 MB"/>'
# Each writer of a node that ends waits so long for readers that may have been killed.
_LINGER = "<WriterLingerDuration>0.2 s</WriterLingerDuration>"
CYCLONE_SETTINGS = (
    f"<CycloneDDS><Domain><Internal>{_KEPT}{_ROOM}{_LINGER}</Internal></Domain></CycloneDDS>"
)


def _prepare_cyclone(environment: MutableMapping[str, str]) -> list[str]:
    """Put the settings before the user's: Cyclone DDS lets the last that names a setting decide."""
    given = environment.get(URI, "").removeprefix(CYCLONE_SETTINGS).removeprefix(",")
    environment[URI] = f"{CYCLONE_SETTINGS},{given}" if given else CYCLONE_SETTINGS
    files = (Path(part.strip().removeprefix("file://")) for part in given.split(","))
    texts = [given, *(file.read_text("utf-8", "replace") for file in files if _is_file(file))]
    if not any("Watermarks" in text for text in texts):
        return []
    risk = "a viewer that is stopped or killed may block a node and end the scan; remove them"
    return [f"{URI} sets Watermarks, which replace those of this package: {risk}"]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a fragment of XML may be no path at all
        return False


RANGE, PEERS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS"
PROFILES = "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Variable that Fast DDS 2.14 reads, when the first participant is made."""
NEWER = "FASTDDS_DEFAULT_PROFILES_FILE"
"""Its name in Fast DDS 3."""
LOCAL = "DEFAULT_FASTRTPS_PROFILES.xml"
"""File of the current folder that Fast DDS reads too, unless SKIP_DEFAULT_XML_FILE is 1."""

SEGMENT = 32 * 2**20
"""Bytes of shared memory of a participant; config/fastdds.xml argues this and what follows."""
CHECK = 150.0
"""Longest check, ms, whether a participant listens, during which nothing is published."""
HEARTBEAT = 0.1
"""Longest heartbeat, s: a lost block has to come again within the scan's window of 0.4 s."""
REPEAT = 0.1
"""Least time, s, until a message is sent again: a reader that hangs asks at each heartbeat."""
KEPT = 15_000
"""Messages that a writer keeps for a reader that does not acknowledge."""

SHARED = "fastdds.xml"
"""Our profile with shared memory and UDP."""
UDP_ALONE = NETWORK, COMPUTER = "fastdds_udp.xml", "fastdds_local.xml"
"""Our profiles without shared memory: for all networks, and for this computer alone."""

_HOLDS_UP = "a viewer that is slow, stopped or killed can hold up the scan"


def _prepare_fast_dds(environment: MutableMapping[str, str], *, viewing: bool) -> list[str]:
    """Let Fast DDS read our profiles, unless it reads the user's."""
    ours = share_directory() / "config"
    said, files = [], []
    given = environment.get(PROFILES, "")
    if given and Path(given).parent != ours:
        files.append(Path(given))
    elif not given and (newer := environment.get(NEWER)):
        said.append(f"{NEWER}={newer} is not read by Jazzy's Fast DDS: set {PROFILES} instead")
    if environment.get("SKIP_DEFAULT_XML_FILE") != "1" and Path(LOCAL).is_file():
        files.append(Path(LOCAL).absolute())
    if not files:
        environment[PROFILES] = str(ours / _profile(environment, viewing=viewing))
    return [*said, *(sentence for file in files for sentence in lacking(file, environment))]


def _profile(environment: MutableMapping[str, str], *, viewing: bool) -> str:
    """Return the name of our profile, and set the range of discovery that goes with it.

    ROS adds shared memory for LOCALHOST whatever a profile says. A profile does what that range
    means in its place, unless peers are given or ROS_LOCALHOST_ONLY asks for it.
    """
    ours = environment.get(PROFILES, "").endswith(COMPUTER)
    local = ours or environment.get(RANGE) == "LOCALHOST"
    by_ros = environment.get("ROS_LOCALHOST_ONLY") == "1" or (local and environment.get(PEERS))
    if by_ros or not (viewing or sockets_hold(in_flight())):
        return SHARED
    if local:
        environment[RANGE] = "SYSTEM_DEFAULT"
    return COMPUTER if local else NETWORK


def in_flight() -> int:
    """Bytes that a socket has to hold; the profile argues this."""
    tree = ET.parse(share_directory() / "config" / NETWORK)  # noqa: S314 - our own file
    return int(tree.findtext(".//{*}receiveBufferSize", ""))


def sockets_hold(size: int) -> bool:
    """Return whether the system lets a socket receive so many bytes before anybody reads them."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
        return probe.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) >= size


def lacks_room(memory: Path = MEMORY) -> list[str]:
    """Say where a participant's shared memory is more than there is."""
    if not memory.is_dir() or (free := shutil.disk_usage(memory).free) > SEGMENT:
        return []
    sizes = f"{free / 1e6:.0f} MB free, and a node takes {SEGMENT / 1e6:.0f} MB"
    instead = "Fast DDS sends over UDP instead; give it more, as by 'docker run --shm-size=1g'"
    return [f"{memory} has {sizes}: {instead}"]


def lacking(file: Path, environment: Mapping[str, str] = os.environ) -> list[str]:
    """Say what a scan needs and the profiles of a file do not give: element, value, reason."""
    try:
        root = ET.parse(file).getroot()  # noqa: S314 - the user's own, which Fast DDS reads too
    except (OSError, ET.ParseError, LookupError, ValueError) as error:
        return [f"{file}: {error}; Fast DDS uses its defaults, with which {_HOLDS_UP}"]
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]  # without the name space
    found = [*_lacks_memory(root, environment), *_lacks_heartbeats(root)]
    return [f"{file}: {sentence}, or {_HOLDS_UP}" for sentence in found]


def _lacks_memory(root: ET.Element, environment: Mapping[str, str]) -> Iterator[str]:
    """Look at the shared memory of the default participant: its own, and what ROS adds."""
    participant = next(_defaults(root, "participant"), None)
    used, builtin = [], True
    if participant is not None:
        used = [_text(each) for each in participant.iterfind("rtps/userTransports/transport_id")]
        builtin = _text(participant.find("rtps/useBuiltinTransports")) not in ("false", "0")
    memories = (
        each
        for each in root.iter("transport_descriptor")
        if _text(each.find("type")) == "SHM" and _text(each.find("transport_id")) in used
    )
    added = environment.get(RANGE) == "LOCALHOST"
    if (memory := next(memories, None)) is not None:
        if (size := _number(memory.find("segment_size"))) < SEGMENT:
            yield f"segment_size is {size:.0f}: give at least {SEGMENT}"
        check = memory.find("healthy_check_timeout_ms")
        if (longest := 1000.0 if check is None else _number(check)) > CHECK:
            yield f"healthy_check_timeout_ms is {longest:.0f}: give at most {CHECK:.0f}"
    elif builtin or added:
        yield (
            "the default participant names no transport of type SHM in userTransports: name one"
            f" with segment_size of at least {SEGMENT} and healthy_check_timeout_ms of at most"
            f" {CHECK:.0f}; or UDP alone, as {NETWORK} does"
        )


def _lacks_heartbeats(root: ET.Element) -> Iterator[str]:
    writer = next(_defaults(root, "data_writer", "publisher"), None)
    if writer is None:
        yield (
            "no data_writer is the default profile: give one with heartbeatPeriod of at most"
            f" {HEARTBEAT:g} s, nackSupressionDuration of at least {REPEAT:g} s and max_samples of"
            f" at least {KEPT}"
        )
        return
    period = writer.find("times/heartbeatPeriod")
    seconds = 3.0 if period is None else _seconds(period)
    if seconds > HEARTBEAT:
        yield f"heartbeatPeriod is {seconds:g} s: give at most {HEARTBEAT:g} s"
    repeat = writer.find("times/nackSupressionDuration")
    if (pause := 0.0 if repeat is None else _seconds(repeat)) < REPEAT:
        yield f"nackSupressionDuration is {pause:g} s: give at least {REPEAT:g} s"
    kept = writer.find("topic/resourceLimitsQos/max_samples")
    samples = 5000.0 if kept is None else _number(kept)
    if 0.0 < samples < KEPT:  # 0 and less are no limit
        yield f"max_samples is {samples:.0f}: give at least {KEPT}"


def _defaults(root: ET.Element, *tags: str) -> Iterator[ET.Element]:
    for tag in tags:
        for each in root.iter(tag):
            if each.get("is_default_profile") in ("true", "1"):
                yield each


def _seconds(duration: ET.Element) -> float:
    return _number(duration.find("sec")) + 1e-9 * _number(duration.find("nanosec"))


def _text(element: ET.Element | None) -> str:
    return (element.text or "").strip() if element is not None else ""


def _number(element: ET.Element | None) -> float:
    """Return an element's number, 0 where it has none: what Fast DDS takes for the default."""
    try:
        return float(_text(element))
    except ValueError:
        return 0.0
