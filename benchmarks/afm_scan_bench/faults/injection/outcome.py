"""What became of a trial in this process: refused by name, answered, or something promised lost."""

import contextlib
import io
import signal
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

from attrs import Factory, define, frozen

from afm_scan_ros.cli.main import main
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.report.table import Row

PATIENCE = 20
"""Seconds after which a trial counts as one that hangs."""
REFUSED = "refused"
_SHOWN = 3


class LossError(Exception):
    """Something promised was lost; the message states what."""


@frozen
class ProcessEnd:
    """How a command ended, and what it wrote to stderr without its warnings."""

    status: int
    message: str
    warnings: tuple[str, ...]


@define
class Tally:
    """Outcomes of trials by name, and what was lost."""

    outcomes: Counter[str] = Factory(Counter)
    lost: list[str] = Factory(list)

    def judge(self, trial: Callable[[], str], name: str) -> None:
        """Run a trial, which returns its outcome; an error must be one line with ``name`` in it."""
        try:
            with _limited():
                outcome = trial()
        except (InputError, ScanError) as error:
            outcome = REFUSED
            if name not in str(error) or "\n" in str(error):
                self.lost.append(f"refused without its name: {error}")
        except Exception as error:  # noqa: BLE001 - whatever comes out is what is counted
            outcome = "lost"
            where = traceback.extract_tb(error.__traceback__)[-1]
            self.lost.append(f"{type(error).__name__} in {where.name}: {error}")
        self.outcomes[outcome] += 1

    def row(self, fault: str) -> Row:
        """Describe the trials."""
        parts = [f"{count} {outcome}" for outcome, count in self.outcomes.most_common()]
        return {
            "fault": fault,
            "trials": self.outcomes.total(),
            "losses": len(self.lost),
            "figures": "; ".join([", ".join(parts), *self.lost[:_SHOWN]]),
        }


def command(*arguments: object) -> ProcessEnd:
    """Run ``afm-scan`` in this process; raises LossError where it ends other than it may."""
    out, err, before = io.StringIO(), io.StringIO(), sys.argv
    sys.argv = ["afm-scan", *map(str, arguments)]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as end:
        status = int(end.code or 0)
    finally:
        sys.argv = before
    lines = err.getvalue().splitlines()
    warnings = tuple(line for line in lines if line.startswith("warning:"))
    message = [line for line in lines if line not in warnings]
    if status not in (0, 2, 3) or len(message) != (status != 0):
        raise LossError(f"status {status} with {len(message)} lines: {message}")
    return ProcessEnd(status, "".join(message), warnings)


def damaged(path: Path, content: bytes) -> contextlib.AbstractContextManager[None]:
    """Let a file hold other bytes for a while."""

    @contextlib.contextmanager
    def change() -> Iterator[None]:
        before = path.read_bytes()
        path.write_bytes(content)
        try:
            yield
        finally:
            path.write_bytes(before)

    return change()


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    def end(_: int, __: FrameType | None) -> None:
        raise LossError(f"still at it after {PATIENCE} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
