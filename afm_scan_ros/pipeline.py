"""One scan, or one record, without ROS: from its source, through the inverse, to the driver.

The driver has a process of its own, which ramps the outputs down whatever happens to this one.
While it moves one block, this process computes the next, and a thread monitors what was moved and
writes the bag.
"""

import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from attrs import define, field, frozen

from afm_scan_ros.bag.live import (
    TRUE,
    BlockViewer,
    LiveRecorder,
    LiveWriter,
    ScanListener,
)
from afm_scan_ros.core.diagnosis.scan_monitor import ScanMonitor
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_inversion import ScanInversion
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE, MAX_BLOCK, cut_as, end
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.drivers import DriverChoice
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.drivers.guarded import Displacement
from afm_scan_ros.drivers.link import DriverTimeouts
from afm_scan_ros.drivers.safety import SafetySettings

COMPENSATOR, RECORDER, MONITOR = "inversion_compensator", "scan_recorder", "residual_monitor"
"""Parts of a scan that errors name, as the nodes that do the same."""
TRACEBACK = "Traceback (most recent call last)"
UNWRITTEN = 500
"""Blocks that wait to be written at most."""


@frozen(eq=False)
class ScanChain:
    """What a scan runs through.

    ``block`` is the source: it computes samples of the desired displacement (m), or of the drive
    (V) where there is no ``inversion``. ``preflight`` samples are inverted before the scan begins.
    ``scanner`` is the name by which errors call the driver. ``streams`` are recorded.
    ``time_scale`` is 1 for real time, 0 for as fast as possible.
    """

    info: ScanInfo
    block: Callable[[int, int], Trace]
    block_size: int
    driver: DriverChoice
    scanner: str
    streams: Sequence[str]
    time_scale: float
    inversion: ScanInversion | None = None
    preflight: int = 0
    monitor: ScanMonitor | None = None
    safety: SafetySettings = field(factory=SafetySettings)


def run(
    chain: ScanChain, bag: Path, listener: ScanListener, viewers: Sequence[BlockViewer] = ()
) -> None:
    """Run a scan, and record it in a bag; ``viewers`` see what is recorded.

    Raises InputError before it begins, ScanError where it stays incomplete, and KeyboardInterrupt
    after SIGINT or SIGTERM. The outputs are at rest then, and the bag holds what was recorded.
    """
    interrupted: list[int] = []
    with handling(signal.default_int_handler), TemporaryFile("w+", encoding="utf-8") as output:
        driver = DriverProcess(chain.driver, _timeouts(chain), output)
        try:
            with _ramping_down(chain, driver):
                _prepare(chain, driver, listener)
            with (
                LiveWriter(bag, chain.info, chain.streams) as writer,
                ThreadPoolExecutor(1) as pool,
                handling(lambda number, _: interrupted.append(number)),
                _ramping_down(chain, driver),
            ):
                recorder = LiveRecorder(writer, chain.info, listener, viewers)
                _Flow(chain, driver, pool, recorder, interrupted).run()
        except (InputError, ScanError) as error:
            output.seek(0)
            if TRACEBACK in (written := output.read()):
                _add_notes(error, written)
            raise
        finally:
            trouble = driver.close()
    if trouble:
        raise ScanError(f"{chain.scanner}: {trouble}")


def _timeouts(chain: ScanChain) -> DriverTimeouts:
    """Return how long the driver's process waits; at a slower pace drive comes less often."""
    times, opening = chain.safety, chain.safety.opening
    own = {"rest": times.rest, "sign_of_life": times.sign_of_life}
    if not chain.time_scale:
        silence = times.simulated
        return DriverTimeouts(silence, opening, opening, opening, real_time=False, **own)
    starved = times.held * max(1.0, chain.time_scale)
    return DriverTimeouts(times.held, starved, opening, times.held, real_time=True, **own)


def _prepare(chain: ScanChain, driver: DriverProcess, listener: ScanListener) -> None:
    """Let the driver start, and check the scan meanwhile."""
    with _part(chain.scanner):
        chain.driver.refuse_other_instant(chain.info.sampling_instant, chain.info.trigger_offset)
        driver.start(chain.info.sample_period)
    with _part(COMPENSATOR):
        for doing in chain.inversion.preflight(chain.preflight) if chain.inversion else ():
            listener.doing(doing)
    listener.doing("waits for the driver to start")
    with _part(chain.scanner):
        while driver.waiting:
            driver.answer(chain.safety.idle)


@define(eq=False)
class _Flow:
    """The blocks on their way; what becomes of them follows from those before, from no timing."""

    _chain: ScanChain
    _driver: DriverProcess
    _pool: ThreadPoolExecutor
    _recorder: LiveRecorder
    _interrupted: Sequence[int]
    _start: float = field(factory=time.monotonic, init=False)
    _computed: int = field(default=0, init=False)
    _achieved: int = field(default=0, init=False)
    _queue: deque[Trace] = field(factory=deque, init=False)
    _moving: list[Trace] = field(factory=list, init=False)
    _unwritten: deque[Future[None]] = field(factory=deque, init=False)

    def run(self) -> None:
        """Move until all samples are achieved and recorded."""
        while self._achieved < self._chain.info.total_samples:
            if self._interrupted:
                raise KeyboardInterrupt
            self._move_on()
            self._take(0.0 if self._compute() else self._chain.safety.idle)
            while self._unwritten and self._unwritten[0].done():
                self._unwritten.popleft().result()
        for written in self._unwritten:
            written.result()

    def _compute(self) -> bool:
        """Compute a block of drive, where few enough wait; return whether it did."""
        chain, total = self._chain, self._chain.info.total_samples
        count = min(chain.block_size, total - self._computed)
        full = sum(each.x.size for each in self._queue) >= chain.info.window
        waits = chain.inversion is not None and chain.inversion.awaited is not None
        if not count or full or waits or self._is_unwritten():
            return False
        block = chain.block(self._computed, count)
        self._computed += count
        if chain.inversion is None:
            self._give([block])
        else:
            self._record(DESIRED, block)
            self._give(chain.inversion.desired(block, last=self._computed == total))
        return True

    def _give(self, drives: Iterable[Trace]) -> None:
        with _part(COMPENSATOR):
            for drive in drives:
                self._record(DRIVE, drive)
                self._queue.append(drive)

    def _move_on(self) -> None:
        """Give the driver, if it is idle, the drive that is due, in one block."""
        if self._driver.waiting or not self._queue or self._early() > 0.0:
            return
        self._moving = [self._queue.popleft()]
        count, period = self._moving[0].x.size, self._chain.info.sample_period
        most = min(MAX_BLOCK, self._chain.safety.ahead / period)
        while self._queue and (count := count + self._queue[0].x.size) <= most:
            self._moving.append(self._queue.popleft())
        x, y = (np.concatenate([each.axis(axis) for each in self._moving]) for axis in AXES)
        drive = Trace(self._moving[0].first_sample, period, x, y)
        with _part(self._chain.scanner):
            self._driver.advance(drive, last=end(drive) == self._chain.info.total_samples)

    def _early(self) -> float:
        """Return how long (s) the first drive in the queue is to wait, in real time."""
        elapsed = self._queue[0].first_sample * self._chain.info.sample_period
        return self._start + elapsed * self._chain.time_scale - time.monotonic()

    def _take(self, wait: float) -> None:
        """Take the driver's answer, if it is there within ``wait`` s, and let it move on."""
        with _part(self._chain.scanner):
            self._driver.show_life()
            answer = self._driver.answer(wait) if self._moving else None
        if not self._moving:
            self._pause(wait)
        elif answer is not None:
            moved, self._moving = self._moving, []
            self._move_on()
            self._follow(answer, moved)

    def _pause(self, wait: float) -> None:
        """Wait for the pace or the recorder; raises ScanError where readings never come."""
        line = self._chain.inversion.awaited if self._chain.inversion else None
        if line is not None and not self._queue:
            raise ScanError(
                f"{COMPENSATOR}: the next line waits for the end of line {line}, which"
                f" {self._chain.scanner} has not read: feedback_latency_ms is less than the"
                " scanner's latency; give more"
            )
        time.sleep(min(wait, max(0.0, self._early())) if self._queue else wait)

    def _follow(self, answer: Displacement, moved: Sequence[Trace]) -> None:
        """Record an answer in blocks as of the drive; drive what waited for it."""
        if answer.true is not None and TRUE in self._chain.streams:
            for block in cut_as(moved, answer.true):
                self._record(TRUE, block)
        for block in cut_as(moved, answer.measured):
            self._record(ACHIEVED, block)
            if self._chain.inversion is not None:
                self._give(self._chain.inversion.achieved(block))
        self._achieved = end(answer.measured)

    def _record(self, name: str, block: Trace) -> None:
        self._unwritten.append(self._pool.submit(self._write, name, block))

    def _write(self, name: str, block: Trace) -> None:
        with _part(RECORDER):
            self._recorder.add(name, block)
        if self._chain.monitor is not None and name in (DRIVE, ACHIEVED):
            with _part(MONITOR):
                self._recorder.compare(self._chain.monitor, name, block)

    def _is_unwritten(self) -> bool:
        """Return whether the bag is behind; raises ScanError where the scan cannot wait for it."""
        behind = len(self._unwritten) >= UNWRITTEN
        if behind and self._chain.time_scale:
            raise ScanError(f"{RECORDER}: {UNWRITTEN} blocks wait to be written: use a faster disk")
        return behind


@contextmanager
def _part(name: str) -> Iterator[None]:
    """Name the part of a scan that fails; what nobody foresaw keeps its traceback as a note."""
    try:
        yield
    except (InputError, ScanError) as error:
        raise type(error)(f"{name}: {error}") from error
    except Exception as error:
        said = ScanError(f"{name}: {type(error).__name__}: {error}")
        _add_notes(said, "".join(traceback.format_exception(error)))
        raise said from error


@contextmanager
def _ramping_down(chain: ScanChain, driver: DriverProcess) -> Iterator[None]:
    """Bring the outputs to rest after whatever ends the work early, and say so."""
    try:
        yield
    except (InputError, ScanError) as error:
        why = str(error)
        outcome = driver.ramp_down(why)
        if outcome in why:  # the driver itself has ended
            raise
        said = outcome if outcome.startswith(why) else f"{why}; {chain.scanner}: {outcome}"
        another = type(error)(said)
        _add_notes(another, *getattr(error, "__notes__", ()))
        raise another from error
    except BaseException as error:
        driver.ramp_down("interrupted")
        if trouble := driver.close():
            raise ScanError(f"{chain.scanner}: {trouble}") from error
        raise


def _add_notes(error: Exception, *notes: str) -> None:
    for note in filter(None, notes):
        error.add_note(note)


@contextmanager
def handling(handler: Callable[[int, Any], object]) -> Iterator[None]:
    """Handle SIGTERM and SIGINT, the latter also where a background shell had it ignored."""
    taken = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, handler) for number in taken]
    try:
        yield
    finally:
        for number, old in zip(taken, before, strict=True):
            signal.signal(number, old)
