"""The DDS binding as it comes, moving a scan's blocks from process to process and doing nothing.

What the nodes' speed is held against: its own types and calls, each block an object with its floats
in lists, through the hops of a scan to the same readers.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from afm_scan_ros.ros.common import use_node_settings
from afm_scan_ros.ros.cyclone.domain import configuration, domain_id
from afm_scan_ros.ros.cyclone.wire import Participant

READS = {
    "source": (),
    "compensator": ("desired",),
    "scanner": ("drive",),
    "recorder": ("desired", "drive", "achieved", "true"),
}
WRITES = {
    "source": ("desired",),
    "compensator": ("drive",),
    "scanner": ("achieved", "true"),
    "recorder": (),
}
ANY = SampleState.Any | ViewState.Any | InstanceState.Any
AT_ONCE = 100


@dataclass
class Time(IdlStruct, typename="Time"):
    """As ``builtin_interfaces/Time``."""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="Header"):
    """As ``std_msgs/Header``."""

    stamp: Time
    frame_id: str


@dataclass
class Samples(IdlStruct, typename="Block"):
    """As ``DisplacementBlock``."""

    header: Header
    scan_id: str
    first_sample: uint64
    sample_period: float64
    x: sequence[float64]  # type: ignore[type-arg] # the binding's own way
    y: sequence[float64]  # type: ignore[type-arg]
    last: bool


def main(part: str, size: int, blocks: int) -> None:
    """Play one part of a scan of so many blocks; the recorder prints how many it got a second."""
    use_node_settings()
    number = domain_id()
    domain = Domain(number, configuration())
    participant = Participant(number)
    qos = Qos(Policy.Reliability.Reliable(duration(infinite=True)), Policy.History.KeepAll)
    readers = [DataReader(participant, Topic(participant, n, Samples), qos) for n in READS[part]]
    writers = [DataWriter(participant, Topic(participant, n, Samples), qos) for n in WRITES[part]]
    for writer, name in zip(writers, WRITES[part], strict=True):
        while _readers(writer) < sum(name in names for names in READS.values()):
            time.sleep(0.01)
    if part == "source":
        time.sleep(1.0)  # those further on have met as well by then
    times = []
    for block in _taken(participant, readers, blocks) if readers else _made(size, blocks):
        times.append(time.perf_counter())
        for writer in writers:
            writer.write(block)
    for writer in writers:
        while _readers(writer):  # gone when they have it all
            time.sleep(0.01)
    if part == "recorder":
        sys.stdout.write(f"{(blocks - 1) / (times[-1] - times[0])}\n")
    participant.end()
    del domain


def _readers(writer: DataWriter[Samples]) -> int:
    return int(writer.get_publication_matched_status().current_count)  # type: ignore[no-untyped-call] # the binding's is untyped


def _made(size: int, blocks: int) -> Iterator[Samples]:
    values = [1e-9 * i for i in range(size)]
    fields: Any = (
        Header(Time(0, 0), "scanner"),
        "20260101T000000Z",
        0,
        1e-5,
        values,
        values,
        False,
    )
    block = Samples(*fields)
    for number in range(blocks):
        block.first_sample = number * size
        yield block


def _taken(
    participant: Participant, readers: Sequence[DataReader[Samples]], blocks: int
) -> Iterator[Samples]:
    """Yield so many blocks of each reader as they come."""
    waitset = WaitSet(participant)
    for reader in readers:
        waitset.attach(ReadCondition(reader, ANY))
    left = blocks * len(readers)
    while left:
        if not waitset.wait(duration(seconds=30)):
            raise TimeoutError("no block for 30 s")
        for reader in readers:
            taken = [each for each in reader.take(AT_ONCE) if isinstance(each, Samples)]
            left -= len(taken)
            yield from taken
