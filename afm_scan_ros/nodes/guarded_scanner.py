"""The scanner under a watchdog that brings it to rest when those upstream cannot."""

from collections.abc import Callable
from threading import Event, Lock, Thread

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.simulation.scanner import Piezoscanner

PERIOD = 0.02


class GuardedScanner:
    """A scanner whose own thread ramps the drive down as soon as ``trouble`` names some.

    The thread publishes nothing, so no reader that hangs can keep it from ramping down; what it
    did is in ``outcome``. After that the scanner refuses to move.
    """

    def __init__(self, trouble: Callable[[], str | None]) -> None:
        self.outcome: str | None = None
        self._scanner: Piezoscanner
        self._trouble = trouble
        self._lock = Lock()
        self._over = Event()
        self._thread = Thread(target=self._watch, daemon=True)

    def begin(self, scanner: Piezoscanner) -> None:
        """Take a scanner at rest, and watch from now on."""
        self._scanner = scanner
        self._thread.start()

    def advance(self, drive: Trace) -> tuple[Trace, Trace]:
        """Return measured and true displacement (m); raises ScanError once ramped down."""
        with self._lock:
            if self.outcome is not None:
                raise ScanError(self.outcome)
            return self._scanner.advance(drive)

    def ramp_down(self, why: str) -> str:
        """Bring the drive to rest at 0 V, once; return why and how that was done."""
        with self._lock:
            if self.outcome is None:
                ramp = self._scanner.ramp_down()
                self._scanner.advance(ramp)
                duration = len(ramp.x) * ramp.sample_period
                self.outcome = f"{why}; drive ramped down to 0 V within {duration:.3g} s"
            return self.outcome

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join()

    def _watch(self) -> None:
        while not self._over.wait(PERIOD):
            if why := self._trouble():
                self.ramp_down(why)
                return
