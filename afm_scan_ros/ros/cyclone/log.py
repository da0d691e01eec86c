"""Log lines on stderr, in the form that rclpy's have."""

import sys
import time

from attrs import frozen


@frozen
class Logger:
    """Writes ``[LEVEL] [seconds] [name]: text``, as ROS 2's console output."""

    name: str

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
        line = f"[{level}] [{time.time():.9f}] [{self.name}]: {message}\n"
        sys.stderr.write(line)
        sys.stderr.flush()
