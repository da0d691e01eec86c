"""Decides when a scanner's residual exceeds its detection limit, and when no longer."""

from attrs import define, frozen

from afm_scan_ros.core.diagnosis.line_residual import AxisResidual, LineResidual
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


@frozen
class ResidualAlarm:
    """A line by which the residual of an axis began to exceed its limit, or ceased to."""

    axis: str
    line: int
    residual: AxisResidual
    raised: bool


@define
class _AxisWatch:
    """One axis: its alarm, if one stands, and the lines in a row that contradict its state."""

    suspect: float
    lines: int
    alarm: ResidualAlarm | None = None
    _against: int = 0

    def changed(self, axis: str, line: LineResidual) -> ResidualAlarm | None:
        """Take a line; return the alarm that it raises or ends."""
        excess = line.axis(axis).excess
        contradicts = excess <= CALM * self.suspect if self.alarm else excess > self.suspect
        self._against = self._against + 1 if contradicts else 0
        if self._against < self.lines:
            return None
        self._against = 0
        change = ResidualAlarm(axis, line.line, line.axis(axis), raised=not self.alarm)
        self.alarm = change if change.raised else None
        return change


class ResidualWatch:
    """Follows the lines of a scan; one noisy line is no alarm."""

    def __init__(self, suspect: float = ALARM, lines: int = LINES) -> None:
        self._axes = {name: _AxisWatch(suspect, lines) for name in AXES}

    @property
    def alarms(self) -> list[ResidualAlarm]:
        """The alarms that stand."""
        return [axis.alarm for axis in self._axes.values() if axis.alarm]

    def news(self, line: LineResidual) -> list[ResidualAlarm]:
        """Take a line; return the alarms, axis by axis, that it raises or ends."""
        changes = [axis.changed(name, line) for name, axis in self._axes.items()]
        return [change for change in changes if change]
