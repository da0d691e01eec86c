"""Says when a scanner has left what its model knows of it, and when it has come back."""

from attrs import define

from afm_scan_ros.core.diagnosis.line_residual import LineResidual
from afm_scan_ros.core.types import AXES

ALARM = 5.0
"""Residual over its floor above which a line is suspect.

The floor is that of a whole record; on a single line of a healthy scanner a band comes up to some
three times its floor.
"""
CALM = 0.8
"""Share of that up to which a line is calm."""
LINES = 3
"""Suspect lines in a row that make an alarm, and calm ones that end it."""


@define
class _AxisWatch:
    """One axis: its alarm in words, empty without one, and the lines in a row that speak against.

    Against the silence, that is, or against the alarm.
    """

    suspect: float
    lines: int
    alarm: str = ""
    _against: int = 0

    def changed(self, axis: str, line: LineResidual) -> bool:
        """Take a line; return whether the alarm began or ended with it."""
        excess = line.axis(axis).excess
        contradicts = excess <= CALM * self.suspect if self.alarm else excess > self.suspect
        self._against = self._against + 1 if contradicts else 0
        if self._against < self.lines:
            return False
        self._against = 0
        self.alarm = "" if self.alarm else _alarm(axis, line)
        return True


class ResidualWatch:
    """Follows the lines of a scan; one noisy line is no alarm."""

    def __init__(self, suspect: float = ALARM, lines: int = LINES) -> None:
        self._axes = {name: _AxisWatch(suspect, lines) for name in AXES}

    @property
    def alarm(self) -> str:
        """What is beyond the model's known error, in words; empty where nothing is."""
        return "; ".join(axis.alarm for axis in self._axes.values() if axis.alarm)

    def news(self, line: LineResidual) -> list[str]:
        """Say, axis by axis, what changed with a line; mostly nothing."""
        changed = [name for name, axis in self._axes.items() if axis.changed(name, line)]
        return [self._axes[name].alarm or _all_clear(name, line) for name in changed]


def _alarm(axis: str, line: LineResidual) -> str:
    found = line.axis(axis)
    lowest, highest = found.band
    return (
        f"{axis}: by line {line.line} the residual, {1e9 * found.rms:.3g} nm rms, is"
        f" {found.excess:.3g} times the model's known error between {lowest:g} and {highest:g} Hz:"
        " diagnose this scan's bag"
    )


def _all_clear(axis: str, line: LineResidual) -> str:
    return f"{axis}: by line {line.line} the residual is within the model's known error again"
