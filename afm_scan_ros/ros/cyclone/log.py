"""Log lines on stderr, in the form that rclpy's have."""

import sys
import time
from types import CodeType

from attrs import field, frozen


@frozen
class Logger:
    """Writes ``[LEVEL] [seconds] [name]: text``, as ROS 2's console output.

    Raises ValueError, as rclpy does, where one place in the code logs at a second severity.
    """

    name: str
    _severities: dict[tuple[CodeType, int], str] = field(factory=dict, init=False, eq=False)

    def info(self, message: str) -> None:
        """Say what happens."""
        self._write("INFO", message)

    def warning(self, message: str) -> None:
        """Say what is not as it should be, and goes on."""
        self._write("WARN", message)

    def error(self, message: str) -> None:
        """Say what ends the work."""
        self._write("ERROR", message)

    def _write(self, level: str, message: str) -> None:
        caller = sys._getframe(2)  # noqa: SLF001 - the place that logs, as rclpy tells them apart
        if self._severities.setdefault((caller.f_code, caller.f_lasti), level) != level:
            raise ValueError("Logger severity cannot be changed between calls.")
        line = f"[{level}] [{time.time():.9f}] [{self.name}]: {message}\n"
        sys.stderr.write(line)
        sys.stderr.flush()
