"""Publishers that are none of a scan's own, at a random moment of it: refused by name."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, evolve, field
from rclpy.node import Node
from sensor_msgs.msg import Image

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NODES
from afm_scan_bench.faults.injection.trial import PATIENT, SCAN, Trial, numbered, undisturbed
from afm_scan_ros.bag.scan_info import encode_block
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, NodeTopic
from afm_scan_ros.report.table import Row

TRIALS = 15
"""Of each of the four."""
_LONGEST = 1.5
_REASON = re.compile(r"^(\w+ failed: |\w+: (?=/|\w+ failed: |\w+: ))+|; drive ramped.*")
"""What stands around the reason in the last line of a node."""
TOPICS = (DESIRED, DRIVE, ACHIEVED)
SCAN_ID = "this"
STRANGE = ScanInfo("before", 10**18, "raster", 5e-5, 10_000)
"""The scan before, at the same sample period."""


LONG: Mapping[str, object] = {**SCAN, "lines": 145}
"""Eight seconds, so that a foreign node comes before the end, also where the machine is busy."""
SOURCE: Mapping[str, object] = {
    **PATIENT[NODES[0]],
    **LONG,
    "scan_id": SCAN_ID,
    "startup_timeout_s": 20.0,
}


@define
class Met:
    """What became of a scan that a foreign node joined."""

    topic: str
    reason: str = ""
    broken: list[str] = field(factory=list)


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Let each kind of foreign node come as often, at moments drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder), LONG)
        for kind, come in FOREIGN_NODES.items():
            met = numbered(announce, kind, trials, folder)
            done = [meet(where, number, calm, come) for number, where in met]
            broken = [f"{each.topic}: {'; '.join(each.broken)}" for each in done if each.broken]
            reason = Counter(each.reason for each in done if each.reason)
            naming = [f"{count} '{texts}'" for texts, count in reason.most_common()]
            yield row(kind, trials, broken, "; ".join(naming))


def meet(folder: Path, number: int, calm: Undisturbed, come: "Come") -> Met:
    """Let a foreign node join one scan, and see who refuses it."""
    done = Met(TOPICS[number % len(TOPICS)].name)
    moment = float(np.random.default_rng(number).uniform(0.0, _LONGEST))
    with Trial(folder, **{**PATIENT, NODES[0]: SOURCE}) as trial:
        trial.start(*NODES)
        trial.until_running()
        trial.listen(moment)
        foreign = come(trial, TOPICS[number % len(TOPICS)])
        if not trial.until_ended():
            done.broken.append("hung")
        foreign.destroy_node()
        _judge(trial, calm, done)
    return done


def second_node(trial: Trial, topic: NodeTopic) -> Node:
    """Start another node of the kind that publishes the topic: two generators, two scanners."""
    publisher = {DESIRED: NODES[0], DRIVE: NODES[1], ACHIEVED: NODES[2]}[topic]
    own = trial.nodes[publisher]
    trial.start(publisher)
    trial.nodes[f"second {publisher}"] = trial.nodes[publisher]
    trial.nodes[publisher] = own
    return Node("foreign")


def other_type(_: Trial, topic: NodeTopic) -> Node:
    """Publish pictures under the topic's name."""
    foreign = Node("foreign")
    foreign.create_publisher(Image, topic.name, topic.writer)
    return foreign


def other_period(trial: Trial, topic: NodeTopic) -> Node:
    """Publish a block of this scan at twice its sample period."""
    return _publish(trial, topic, evolve(STRANGE, scan_id=SCAN_ID, sample_period=1e-4))


def scan_before(trial: Trial, topic: NodeTopic) -> Node:
    """Publish a block that a scan before left over."""
    return _publish(trial, topic, STRANGE)


def _publish(trial: Trial, topic: NodeTopic, info: ScanInfo) -> Node:
    foreign = Node("foreign")
    publisher = foreign.create_publisher(topic.kind, topic.name, topic.writer)
    trial.until(lambda: publisher.get_subscription_count() > 0)
    samples = np.full(500, 1e-6)
    block = Trace(0, info.sample_period, samples, samples)
    publisher.publish(encode_block(topic.type_name, info, block, last=False))
    return foreign


Come = Callable[[Trial, NodeTopic], Node]
FOREIGN_NODES: dict[str, Come] = {
    "a second node of the publisher's kind": second_node,
    "a foreign node of another type": other_type,
    "a foreign node of another sample period": other_period,
    "a block of the scan before": scan_before,
}


def _judge(trial: Trial, calm: Undisturbed, done: Met) -> None:
    texts = [node.message for node in trial.nodes.values()]
    names = (done.topic, "/scan_info", "restarted")
    naming = [each.strip() for each in texts if any(name in each for name in names)]
    done.reason = _REASON.sub("", min(naming, key=len, default=""))
    if not done.reason:
        done.broken.append(f"nobody named it: {texts}")
    if set(trial.statuses().values()) != {INCOMPLETE}:
        done.broken.append(f"statuses {trial.statuses()}")
    try:
        calm.kept(trial.bag)
    except InputError as error:
        done.broken.append(str(error))
