"""Two network namespaces as two hosts, and a link between them that loses, delays and reorders.

The link is a pair of TUN devices and a process that carries each IP packet from one to the other:
what ``tc netem`` does in the kernel, for kernels that lack it.
"""

import fcntl
import heapq
import multiprocessing
import os
import select
import struct
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import field, frozen

from afm_scan_bench.faults.injection.processes import system

if TYPE_CHECKING:
    from multiprocessing.sharedctypes import Synchronized

ADDRESSES = {f"afm_a_{os.getpid()}": "10.77.0.1", f"afm_b_{os.getpid()}": "10.77.0.2"}
"""Of the hosts, by names of namespaces and devices: none that another run, once killed, left."""
_TUNSETIFF, _IFF_TUN, _IFF_NO_PI = 0x400454CA, 0x0001, 0x1000  # linux/if_tun.h
_LONGEST_PACKET = 65536
PROFILE = """<?xml version="1.0"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors>
    <transport_descriptor><transport_id>network</transport_id><type>UDPv4</type></transport_descriptor>
  </transport_descriptors>
  <participant profile_name="network" is_default_profile="true"><rtps>
    <userTransports><transport_id>network</transport_id></userTransports>
    <useBuiltinTransports>false</useBuiltinTransports>
    <builtin><discovery_config><leaseAnnouncement><sec>1</sec></leaseAnnouncement>
    </discovery_config></builtin>
  </rtps></participant>
  <data_writer profile_name="writer" is_default_profile="true">
    <topic><resourceLimitsQos><max_samples>15000</max_samples></resourceLimitsQos></topic>
    <times><heartbeatPeriod><sec>0</sec><nanosec>20000000</nanosec></heartbeatPeriod>
      <nackSupressionDuration><sec>0</sec><nanosec>200000000</nanosec></nackSupressionDuration>
    </times>
  </data_writer>
</profiles>
"""
"""Of Fast DDS: no shared memory; after a lost announcement, the next comes a second later."""
_FORKING = multiprocessing.get_context("fork")
_ip = partial(system, "/sbin/ip")


@frozen
class NetworkLink:
    """Share of packets lost, delay and its spread (s); a spread lets packets overtake others."""

    loss: float
    delay: float
    spread: float


@frozen
class Carried:
    """Packets that came to the link, and those of them that it lost; ``loss`` is their share."""

    came: "Synchronized[int]" = field(factory=partial(_FORKING.Value, "q"))
    lost: "Synchronized[int]" = field(factory=partial(_FORKING.Value, "q"))
    loss: "Synchronized[float]" = field(factory=partial(_FORKING.Value, "d"))

    def cut(self) -> None:
        """Lose everything from now on."""
        self.loss.value = 1.0


@contextmanager
def two_hosts(link: NetworkLink, seed: int) -> Iterator[Carried]:
    """Make both namespaces, joined by the link; needs root."""
    carried = Carried()
    carried.loss.value = link.loss
    with ExitStack() as made:
        devices = []
        for name, address in ADDRESSES.items():
            _ip("netns", "add", name)
            made.callback(_ip, "netns", "del", name)
            devices.append(os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK))
            made.callback(os.close, devices[-1])
            request = struct.pack("16sH22x", name.encode(), _IFF_TUN | _IFF_NO_PI)
            fcntl.ioctl(devices[-1], _TUNSETIFF, request)
            _ip("link", "set", name, "netns", name)
            _ip("-n", name, "addr", "add", f"{address}/24", "dev", name)
            _ip("-n", name, "link", "set", name, "up")
            _ip("-n", name, "link", "set", "lo", "up")
        given = (*devices, link, seed, carried)
        carrier = _FORKING.Process(target=_carry, args=given, daemon=True)
        carrier.start()
        made.callback(carrier.join)
        made.callback(carrier.kill)
        yield carried


def on_host(name: str, arguments: list[str]) -> list[str]:
    """Return the command that runs another on a host."""
    return ["ip", "netns", "exec", name, *arguments]


def host_environment(name: str) -> dict[str, str]:
    """Return the variables of a process on a host, whose nodes find those of both.

    Both hosts share this machine's memory, through which no packet would pass that can be lost.
    """
    profile = Path(tempfile.gettempdir()) / "afm_scan_two_hosts.xml"
    profile.write_text(PROFILE, "utf-8")
    return {
        **os.environ,
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "ROS_STATIC_PEERS": ";".join({*ADDRESSES.values()} - {ADDRESSES[name]}),
        "ROS_DOMAIN_ID": "0",
    }


def _carry(one: int, other: int, link: NetworkLink, seed: int, carried: Carried) -> None:
    """Carry packets both ways until killed."""
    chance = np.random.default_rng(seed)
    waiting: list[tuple[float, int, int, bytes]] = []
    opposite = {one: other, other: one}
    while True:
        left = max(0.0, waiting[0][0] - time.monotonic()) if waiting else None
        for device in select.select([one, other], [], [], left)[0]:
            packet = os.read(device, _LONGEST_PACKET)
            carried.came.value += 1
            if chance.random() < carried.loss.value:
                carried.lost.value += 1
                continue
            due = time.monotonic() + link.delay + chance.uniform(0.0, link.spread)
            heapq.heappush(waiting, (due, carried.came.value, opposite[device], packet))
        while waiting and waiting[0][0] <= time.monotonic():
            _, _, device, packet = heapq.heappop(waiting)
            os.write(device, packet)
