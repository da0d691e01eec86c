"""Publishers that are none of a scan's own, at a random moment of it: refused by name."""

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, evolve, field

from afm_scan_bench.faults.faults import Say, row
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.processes import INCOMPLETE, NODES
from afm_scan_bench.faults.injection.trial import PATIENT, SCAN, Trial, numbered, undisturbed
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.nodes.messages import block_message
from afm_scan_ros.nodes.topics import ACHIEVED, DESIRED, DRIVE, NodeTopic
from afm_scan_ros.report.table import Row
from afm_scan_ros.ros import Image, Message, Node

TRIALS = 15
"""Of each of the four."""
_LONGEST = 1.5
_REASON = re.compile(r"^(\w+ failed: |\w+: (?=/|\w+ failed: |\w+: ))+|; drive ramped.*")
"""What stands around the reason in a node's last words."""
TOPICS = (DESIRED, DRIVE, ACHIEVED)
SCAN_ID = "this"
STRANGE = ScanInfo("before", 10**18, "raster", 5e-5, 10_000)
"""The scan before, at the same sample period."""


LONG: Mapping[str, object] = {**SCAN, "lines": 145}
"""Eight seconds, so that a stranger comes before the end, also where the machine is busy."""
SOURCE: Mapping[str, object] = {
    **PATIENT[NODES[0]],
    **LONG,
    "scan_id": SCAN_ID,
    "startup_timeout_s": 20.0,
}


@define
class Met:
    """What became of a scan that a stranger came to."""

    topic: str
    words: str = ""
    broken: list[str] = field(factory=list)


def inject(say: Say, trials: int = TRIALS) -> Iterator[Row]:
    """Let each kind of stranger come as often, at moments drawn from the trial's number."""
    with TemporaryDirectory() as folder:
        calm = undisturbed(Path(folder), LONG)
        for kind, come in STRANGERS.items():
            met = numbered(say, kind, trials, folder)
            done = [meet(where, number, calm, come) for number, where in met]
            broken = [f"{each.topic}: {'; '.join(each.broken)}" for each in done if each.broken]
            words = Counter(each.words for each in done if each.words)
            told = [f"{count} '{said}'" for said, count in words.most_common()]
            yield row(kind, trials, broken, "; ".join(told))


def meet(folder: Path, number: int, calm: Undisturbed, come: "Come") -> Met:
    """Let a stranger come to one scan, and see who refuses it."""
    done = Met(TOPICS[number % len(TOPICS)].name)
    moment = float(np.random.default_rng(number).uniform(0.0, _LONGEST))
    with Trial(folder, **{**PATIENT, NODES[0]: SOURCE}) as trial:
        trial.start(*NODES)
        trial.until_running()
        trial.listen(moment)
        stranger = come(trial, TOPICS[number % len(TOPICS)])
        if not trial.until_ended():
            done.broken.append("hung")
        stranger.destroy_node()
        _judge(trial, calm, done)
    return done


def second_node(trial: Trial, topic: NodeTopic) -> Node:
    """Start another node of the kind that publishes the topic: two generators, two scanners."""
    publisher = {DESIRED: NODES[0], DRIVE: NODES[1], ACHIEVED: NODES[2]}[topic]
    own = trial.nodes[publisher]
    trial.start(publisher)
    trial.nodes[f"second {publisher}"] = trial.nodes[publisher]
    trial.nodes[publisher] = own
    return Node("stranger")


def other_type(_: Trial, topic: NodeTopic) -> Node:
    """Publish pictures under the topic's name."""
    stranger = Node("stranger")
    stranger.create_publisher(Image, topic.name, topic.writer)
    return stranger


def other_period(trial: Trial, topic: NodeTopic) -> Node:
    """Publish a block of this scan at twice its sample period."""
    return _publish(trial, topic, evolve(STRANGE, scan_id=SCAN_ID, sample_period=1e-4))


def scan_before(trial: Trial, topic: NodeTopic) -> Node:
    """Publish a block that a scan before left over."""
    return _publish(trial, topic, STRANGE)


def _publish(trial: Trial, topic: NodeTopic, info: ScanInfo) -> Node:
    stranger = Node("stranger")
    publisher = stranger.create_publisher(topic.kind, topic.name, topic.writer)
    trial.until(lambda: publisher.get_subscription_count() > 0)
    samples = np.full(500, 1e-6)
    message: Message = block_message(
        topic.kind, info, Trace(0, info.sample_period, samples, samples), last=False
    )
    publisher.publish(message)
    return stranger


Come = Callable[[Trial, NodeTopic], Node]
STRANGERS: dict[str, Come] = {
    "a second node of the publisher's kind": second_node,
    "a stranger of another type": other_type,
    "a stranger of another sample period": other_period,
    "a block of the scan before": scan_before,
}


def _judge(trial: Trial, calm: Undisturbed, done: Met) -> None:
    said = [node.said for node in trial.nodes.values()]
    names = (done.topic, "/scan_info", "restarted")
    told = [each.strip() for each in said if any(name in each for name in names)]
    done.words = _REASON.sub("", min(told, key=len, default=""))
    if not done.words:
        done.broken.append(f"nobody named it: {said}")
    if set(trial.statuses().values()) != {INCOMPLETE}:
        done.broken.append(f"statuses {trial.statuses()}")
    try:
        calm.kept(trial.bag)
    except InputError as error:
        done.broken.append(str(error))
