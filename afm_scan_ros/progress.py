"""Progress of long computations: the time that they have taken, and what is left of them."""

from collections.abc import Callable
from time import monotonic

from attrs import define, field

from afm_scan_ros.core.types import ProgressCallback, Step


@define
class Stopwatch:
    """Time since it was made (s), and how much is left where parts are counted.

    What is left is told from the time that the parts which are over have taken. As text it is both.
    """

    _clock: Callable[[], float] = monotonic
    _began: float = field(init=False)
    _step: Step | None = field(default=None, init=False)
    _counts_from: float = field(default=0.0, init=False)
    _counted: float = field(default=0.0, init=False)

    @_began.default
    def _now(self) -> float:
        return self._clock()

    @property
    def elapsed(self) -> float:
        """Time since it was made, s."""
        return self._clock() - self._began

    def hear(self, doing: str) -> None:
        """Take note of what is being done from now on; a smaller count is one of other parts."""
        before, step = self._step, doing if isinstance(doing, Step) else None
        self._step = step
        if step and (before is None or step.done < before.done):
            self._counts_from = 0.0 if step.done else self.elapsed
        if step and (before is None or step.done != before.done):
            self._counted = self.elapsed

    @property
    def left(self) -> float | None:
        """Time (s) that is left; None where nothing tells it, below zero where it was too short."""
        whole = self._step.left(self._counted - self._counts_from) if self._step else None
        return None if whole is None else whole - (self.elapsed - self._counted)

    def __str__(self) -> str:
        left, elapsed = self.left, f"{self.elapsed:.0f} s"
        if self._step is None or left is None or left < 1.0:
            return elapsed
        return f"{elapsed}, {'at least' if self._step.more else 'about'} {left:.0f} s left"


def timed(show: Callable[[str], object]) -> ProgressCallback:
    """Return a progress callback that shows each step with the time elapsed, and the time left.

    Parameters
    ----------
    show
        Is called with a line of text, as ``print`` or a logger's ``info``.

    Returns
    -------
    ProgressCallback
        For the argument ``progress`` of one computation. The time left is stated where parts are
        counted: axes, images, scans, or hypotheses, of which more may follow.

    Examples
    --------
    >>> import afm_scan_ros as afm
    >>> progress = afm.timed(print)
    >>> progress("x: looking for modes")  # doctest: +ELLIPSIS
    x: looking for modes (... s)
    """
    watch = Stopwatch()

    def report(doing: str) -> None:
        watch.hear(doing)
        show(f"{doing} ({watch})")

    return report
