"""The time from a fault to outputs at rest, from what the process that owns them recorded.

A calibration record of hysteresis is made in real time, by a source as it is and a scanner's node
with a fault in it.
"""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, field, frozen

from afm_scan_bench.faults.faults import Announce, row
from afm_scan_bench.faults.injection.processes import INCOMPLETE
from afm_scan_bench.faults.injection.trial import PATIENCE, Trial, numbered
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.drivers.base import Reading
from afm_scan_ros.drivers.link import Link
from afm_scan_ros.drivers.settings import ScannerSettings
from afm_scan_ros.drivers.simulated import SimulatedScanner
from afm_scan_ros.nodes import piezoscanner_sim
from afm_scan_ros.nodes.peers import FAILED
from afm_scan_ros.nodes.topics import ACHIEVED
from afm_scan_ros.report.table import Row
from afm_scan_ros.ros import Node, SignalHandlerOptions, SingleThreadedExecutor, init
from afm_scan_ros.ros.cyclone import HOLDS_LOCK

TRIALS = 5
"""Of each fault."""
SILENCE = 0.5
"""Seconds: upstream_timeout_s by default."""
RAMP_SLEW = 40.0
"""V/s: ramp_down_slew_v_per_s of config/plant.yaml."""
LATENCY = 0.05
"""Seconds that the machine may take to let a process run."""
SOURCE, SCANNER = "excitation_generator", "piezoscanner_sim"
RECORD: Mapping[str, object] = {
    "kind": "hysteresis",
    "required_nodes": [SCANNER],
    "min_subscriptions": 1,
    "block_size": 500,
    "window": 5000,
}
FAULT_AT = 20_000
"""Sample from which there is a fault: after a second, with 4 V on both axes."""
HANG = 120
"""Seconds."""
SMALL_CACHE = (
    "<CycloneDDS><Domain><Internal><Watermarks><WhcHigh>64kB</WhcHigh><WhcHighInit>64kB"
    "</WhcHighInit><WhcAdaptive>false</WhcAdaptive></Watermarks></Internal></Domain></CycloneDDS>"
)
"""Settings with which a stopped reader blocks the writer after four blocks."""


def _raise(*_: object) -> None:
    raise ZeroDivisionError("injected")


def _hang() -> None:
    """Sleep in C, and keep the interpreter locked."""
    ctypes.PyDLL(None).sleep(HANG)


def _note(log: object) -> None:
    """Write down the moment of a fault, beside the log of the outputs."""
    path = Path(f"{log}.fault")
    if not path.exists():
        path.write_text(str(time.monotonic()), "utf-8")


@frozen
class Fault:
    """A fault; ``message`` is in the scan's nodes' reports of it.

    From FAULT_AT on, ``method`` of the scanner's node does ``act`` in place of its work, or the
    driver ``driver`` of this module fails; or the bench sends ``number`` to ``to``.
    """

    name: str
    message: str
    method: str = ""
    act: Callable[[], None] = _raise
    driver: str = ""
    number: int = 0
    to: str = "node"
    viewer: bool = False


_BUG = "ZeroDivisionError: injected"
_SILENT = f"{SCANNER} has been silent"
FAULTS = (
    Fault("exception in the callback of a block", _BUG, "consume"),
    Fault("exception in the callback of node_state", _BUG, "_hear"),
    Fault("exception in the periodic work", _BUG, "step"),
    Fault("exception in publish", _BUG, "send"),
    Fault("a callback hangs, the interpreter locked", _SILENT, "consume", _hang),
    Fault("publish blocks, the interpreter locked", _SILENT, viewer=True),
    Fault("node stopped (SIGSTOP)", _SILENT, number=signal.SIGSTOP),
    Fault("node killed (SIGKILL)", _SILENT, number=signal.SIGKILL),
    Fault("SIGINT to the node's group", "interrupted by SIGINT", number=signal.SIGINT, to="group"),
    Fault(
        "SIGTERM to the node's group", "interrupted by SIGTERM", number=signal.SIGTERM, to="group"
    ),
    Fault("SIGTERM to the driver's process", "by SIGTERM", number=signal.SIGTERM, to="driver"),
    Fault("exception in the scanner", _BUG, driver="RaisingScanner"),
    Fault("exception in the watchdog", _BUG, driver="RaisingWatchdog"),
)
BY_NAME = {fault.name: fault for fault in FAULTS}


class RaisingScanner(SimulatedScanner):
    """A scanner whose own code raises within a scan."""

    def __init__(self, settings: ScannerSettings, **options: object) -> None:
        super().__init__(settings, **options)  # type: ignore[arg-type] # what the node gives
        self._noted_in = options["output_log"]

    def advance(self, drive: Trace) -> Reading:
        """Move, up to the fault."""
        if drive.first_sample >= FAULT_AT:
            _note(self._noted_in)
            self.fail()
        return super().advance(drive)

    def fail(self) -> None:
        """Do what is wrong."""
        _raise()


class RaisingWatchdog(RaisingScanner):
    """A scanner in whose process the watchdog's wait raises."""

    def fail(self) -> None:
        """Break the next wait."""
        setattr(Link, "receive", _raise)  # noqa: B010 - no method, to the type checker


def faulty_node(name: str, log: str) -> int:
    """Run the scanner's node with a fault in it; return its status."""
    fault = BY_NAME[name]
    if fault.driver:
        piezoscanner_sim.DRIVER = f"{__name__}:{fault.driver}"
    if fault.method:
        _break(fault.method, fault.act, log)
    return piezoscanner_sim.main()


def _break(method: str, act: Callable[[], None], log: str) -> None:
    kind = piezoscanner_sim.PiezoscannerSim
    whole = getattr(kind, method)

    def broken(node: piezoscanner_sim.PiezoscannerSim, *given: object, **named: object) -> object:
        if node.next_sample < FAULT_AT:
            return whole(node, *given, **named)
        _note(log)
        act()
        return None

    setattr(kind, method, broken)


@define
class DriveOutcome:
    """What became of one scan; the time (s) is from the fault, the drive (V) that of the fault."""

    seconds: float = float("nan")
    drive: float = float("nan")
    broken: list[str] = field(factory=list)

    @property
    def allowed(self) -> float:
        """Longest time (s) to rest: silence, the ramp from that drive, the machine's own."""
        return SILENCE + 0.5 * np.pi * self.drive / RAMP_SLEW + LATENCY


@define(eq=False)
class Scanner:
    """The faulty node, its driver's process, and a viewer that may block it."""

    fault: Fault
    log: Path
    node: "subprocess.Popen[bytes]"
    viewer: "subprocess.Popen[bytes] | None" = None
    driver: int = 0

    @classmethod
    def start(cls, folder: Path, fault: Fault) -> "Scanner":
        """Start them; what the node writes lies beside the log."""
        log = folder / "outputs.txt"
        run = (
            f"import sys; from {__name__} import faulty_node; sys.exit(faulty_node(*sys.argv[1:3]))"
        )
        given = {
            "output_log": log,
            "min_subscriptions": int(fault.viewer),
            "min_true_subscriptions": 0,
        }
        arguments = [
            argument for pair in given.items() for argument in ("-p", f"{pair[0]}:={pair[1]}")
        ]
        blocks = {"CYCLONEDDS_URI": SMALL_CACHE, HOLDS_LOCK: "1"} if fault.viewer else {}
        with (folder / "node.txt").open("wb") as output:
            node = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                [sys.executable, "-c", run, fault.name, str(log), "--ros-args", *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                env={**os.environ, **blocks},
            )
        view = f"from {__name__} import view; view()"
        viewer = subprocess.Popen([sys.executable, "-c", view]) if fault.viewer else None  # noqa: S603
        return cls(fault, log, node, viewer)

    def inject(self) -> None:
        """Do what is done from outside."""
        if self.viewer is not None:
            self.viewer.send_signal(signal.SIGSTOP)
        if self.fault.number:
            _note(self.log)
            send = os.killpg if self.fault.to == "group" else os.kill
            send(self.driver if self.fault.to == "driver" else self.node.pid, self.fault.number)

    def find_driver(self) -> None:
        """Learn the number of the driver's process."""
        children = Path(f"/proc/{self.node.pid}/task/{self.node.pid}/children")
        self.driver = int(children.read_text("utf-8").split()[0])

    def outputs(self) -> Array:
        """Return the record: moment (s), next sample, x and y (V), a row for each block."""
        if not self.log.exists():
            return np.empty((0, 4))
        lines = self.log.read_text("utf-8").rpartition("\n")[0].splitlines()
        return np.array([[float(argument) for argument in line.split()] for line in lines]).reshape(
            -1, 4
        )

    def is_at_rest(self) -> bool:
        """Return whether the record ends with outputs at 0 V."""
        record = self.outputs()
        return bool(record.size and np.all(record[-1, 2:] == 0.0) and record[-1, 1] > FAULT_AT)

    def has_ended(self) -> bool:
        """Return whether the driver's process is gone."""
        return not Path(f"/proc/{self.driver}").exists()

    def kill(self) -> None:
        """Kill the node, and what reads it."""
        for process in (self.node, self.viewer):
            if process is not None:
                process.kill()
                process.wait()


def view() -> None:
    """Read the displacement reliably, as somebody's viewer does."""
    init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("viewer")
    node.create_subscription(ACHIEVED.kind, ACHIEVED.name, lambda _: None, ACHIEVED.reader)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while True:
        executor.spin_once(timeout_sec=1.0)


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Inject each fault so many times."""
    with TemporaryDirectory() as folder:
        for number, fault in enumerate(FAULTS):
            scans = numbered(announce, f"{fault.name},", trials, str(Path(folder) / str(number)))
            yield _row(fault, [endanger(where, fault) for _, where in scans])


def endanger(folder: Path, fault: Fault) -> DriveOutcome:
    """Inject a fault into one scan, and see when the outputs were at rest."""
    folder.parent.mkdir(exist_ok=True)
    done = DriveOutcome()
    with Trial(folder, **{SOURCE: RECORD}) as trial:
        trial.start(SOURCE)
        scanner = Scanner.start(folder, fault)
        try:
            _follow(trial, scanner, done)
        finally:
            scanner.kill()
        if not trial.until(scanner.has_ended, PATIENCE):
            done.broken.append("the driver's process outlived its node")
    return done


def _follow(trial: Trial, scanner: Scanner, done: DriveOutcome) -> None:
    if not trial.until(lambda: len(scanner.outputs()) > 0):
        done.broken.append("the scan did not begin")
        return
    scanner.find_driver()
    trial.until(lambda: scanner.outputs()[-1, 1] >= FAULT_AT)
    scanner.inject()
    if not trial.until(scanner.is_at_rest):
        done.broken.append("the outputs stayed up")
        return
    record = scanner.outputs()
    begun = Path(f"{scanner.log}.fault")
    moment = float(begun.read_text("utf-8")) if begun.exists() else record[-2, 0]
    done.seconds = record[-1, 0] - moment
    done.drive = float(np.max(np.abs(record[-2, 2:])))
    _judge_words(trial, scanner, done)


def _judge_words(trial: Trial, scanner: Scanner, done: DriveOutcome) -> None:
    """See that both nodes failed, unless one hangs, and that somebody named the reason."""
    if scanner.fault.message != _SILENT:
        trial.until(lambda: scanner.node.poll() is not None)
        if scanner.node.returncode not in (1, INCOMPLETE):
            done.broken.append(f"the scanner's node ended with {scanner.node.returncode}")
    trial.until_ended()
    if trial.statuses()[SOURCE] != INCOMPLETE:
        done.broken.append(f"the source ended with {trial.statuses()[SOURCE]}")
    failed = [each.reason for each in trial.heard if each.state == FAILED]
    if not any(scanner.fault.message in reason for reason in failed):
        done.broken.append(f"no node reported '{scanner.fault.message}', but {failed}")


def _row(fault: Fault, done: Sequence[DriveOutcome]) -> Row:
    times = [each.seconds for each in done]
    late = [each for each in done if each.seconds > each.allowed]
    broken = ["; ".join(each.broken) for each in done if each.broken]
    broken += [f"at rest after {each.seconds:.2f} s, not {each.allowed:.2f}" for each in late]
    figures = f"at rest after {median(times):.2f} s, worst {max(times):.2f}"
    drives = (
        f"from {min(each.drive for each in done):.1f} to {max(each.drive for each in done):.1f} V"
    )
    return row(fault.name, len(done), broken, f"{figures}; {drives}")
