"""Where samples stand still, every node of the scan names the one at which they do."""

from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from attrs import define, field, frozen
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.nodes.peers import DONE, READY, RUNNING, Peers, Report
from afm_scan_ros.nodes.scan_node import COMMON, ScanNode

READS = {  # in the order of the data flow
    "source": (),
    "compensator": ("source",),
    "scanner": ("compensator",),
    "monitor": ("source", "scanner"),
    "recorder": ("source", "compensator", "scanner"),
}
NODES = tuple(READS)
BLOCK, WINDOW, TOTAL = 200, 4000, 12_000
INFO = ScanInfo("now", 10**18, "creep", 1e-4, TOTAL, window=WINDOW, nodes=NODES)
TICK, LIMIT, PAUSE = 0.02, 0.3, 0.12
"""Seconds between two states of a node, that samples may stand still, that a node may seem to."""
HOLDS_BACK = WINDOW // 2 - 3 * BLOCK
"""Most samples of a preview and a latency together: nodes refuse a window of less than twice."""


@frozen
class Faults:
    """Who stops after which sample, if anybody; what two nodes hold back, and all nodes' speeds."""

    victim: str
    stops_at: int
    held: dict[str, int]
    speed: dict[str, int]


@st.composite
def faults(draw: st.DrawFn, *victims: str) -> Faults:
    preview = draw(st.integers(0, HOLDS_BACK))
    latency = draw(st.integers(0, HOLDS_BACK - preview))
    return Faults(
        draw(st.sampled_from(victims)),
        draw(st.integers(1, TOTAL // BLOCK - 1)) * BLOCK,
        {"compensator": preview, "scanner": latency},
        {name: BLOCK * draw(st.integers(1, 4)) for name in NODES},
    )


@define
class Chain:
    """Nodes that take what there is, as fast as they can; the source keeps to the window."""

    faults: Faults
    reach: dict[str, int] = field(factory=lambda: dict.fromkeys(NODES, 0))

    def move(self) -> None:
        for name in NODES:
            free = min((self._output(each) for each in READS[name]), default=TOTAL)
            if name == "source":
                free = min(TOTAL, min(self.reach.values()) + WINDOW)
            if name == self.faults.victim:
                free = min(free, self.faults.stops_at)
            self.reach[name] = max(self.reach[name], min(free, self._after(name)))

    def _after(self, name: str) -> int:
        return self.reach[name] + self.faults.speed[name]

    def _output(self, name: str) -> int:
        """Return up to which sample others can read: whole blocks, and all after the last one."""
        if (reach := self.reach[name]) == TOTAL:
            return TOTAL
        return max(0, reach - self.faults.held.get(name, 0)) // BLOCK * BLOCK

    @property
    def done(self) -> bool:
        return set(self.reach.values()) == {TOTAL}


def state(name: str, reach: int) -> str:
    if name == "source":
        return RUNNING
    return {0: READY, TOTAL: DONE}.get(reach, RUNNING)


def verdicts(chain: Chain, watcher: str, silent: str = "") -> Iterator[str | None]:
    """Yield what a node says, at each moment of a scan and while it stands still.

    A ``silent`` victim says nothing after it has stopped.
    """
    peers, now, advanced = Peers(), 100.0, 100.0
    peers.follow(NODES, watcher, INFO.scan_id, now)
    peers.begin(now)
    while not chain.done and now < 103.0:
        before = dict(chain.reach)
        chain.move()
        now += TICK
        advanced = advanced if chain.reach[watcher] == before[watcher] else now
        reports = {
            name: Report(
                name,
                INFO.scan_id,
                state(name, reach),
                reach,
                "",
                now,
                advanced,
            )
            for name, reach in chain.reach.items()
        }
        for name, report in reports.items():
            if name != silent or report.next_sample > before[name] or not before[name]:
                peers.hear(report)
        yield peers.standstill(reports[watcher], INFO, now, LIMIT, PAUSE)


@given(faults(*NODES), st.sampled_from(NODES))
def test_whoever_watches_names_the_node_that_stopped(given_: Faults, watcher: str) -> None:
    said = {each for each in verdicts(Chain(given_), watcher) if each}
    where = f"it stands at sample {given_.stops_at}"
    assert said == {f"{given_.victim} has finished no sample for {LIMIT:g} s: {where}"}


@given(faults(*NODES), st.data())
def test_one_that_says_nothing_is_named_for_that(given_: Faults, data: st.DataObject) -> None:
    watcher = data.draw(st.sampled_from([name for name in NODES if name != given_.victim]))
    said = {each for each in verdicts(Chain(given_), watcher, given_.victim) if each}
    assert {each.partition(" for ")[0] for each in said} == {f"{given_.victim} has been silent"}


@given(faults(""), st.sampled_from(NODES))
def test_while_samples_advance_nobody_is_named(given_: Faults, watcher: str) -> None:
    assert not any(verdicts(Chain(given_), watcher))


def longest_standstill(progress_timeout: float, block: float, heartbeat: float) -> float:
    settings = {"real_time": True, "time_scale": 1.0, "progress_timeout_s": progress_timeout}
    safety = SafetySettings(heartbeat=heartbeat)
    node = SimpleNamespace(settings=settings, safety=safety, _longest_block=block)
    return ScanNode.longest_standstill(node)  # type: ignore[arg-type]


@given(st.floats(0.001, 1.0), st.floats(0.01, 0.1))
def test_a_node_stands_for_no_longer_than_is_stated(block: float, heartbeat: float) -> None:
    """From what it finished last, of which the others hear up to a heartbeat later."""
    (timeout,) = (each for each in COMMON if each.name == "progress_timeout_s")
    noticed = heartbeat + longest_standstill(timeout.default, block, heartbeat)
    assert noticed == pytest.approx(timeout.default + block)


def test_a_node_that_works_is_heard_in_time_at_the_least_limit() -> None:
    """Its progress is heard within a block and a heartbeat."""
    (timeout,) = (each for each in COMMON if each.name == "progress_timeout_s")
    heartbeat = SafetySettings().heartbeat
    assert longest_standstill(timeout.low, 0.02, heartbeat) > 0.02 + 2.0 * heartbeat
