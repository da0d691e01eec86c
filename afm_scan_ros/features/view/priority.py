"""Lets a process run where nothing else wants to; imports nothing, so that it comes first."""

import os
from contextlib import suppress
from pathlib import Path

AUTOGROUP = Path("/proc/self/autogroup")
"""Weight of a session: Linux may schedule sessions first, and niceness only within one."""


def give_way(niceness: int) -> None:
    """Lower the priority of this process and of its session, which it has of its own."""
    os.nice(max(0, niceness - os.nice(0)))
    with suppress(OSError):  # Linux without it, or another system
        AUTOGROUP.write_text(str(niceness), "ascii")


def run_after(niceness: int, code: str) -> str:
    """Return the code of a process that gives way before it imports anything else."""
    return (
        f"from afm_scan_ros.features.view.priority import give_way; give_way({niceness});"
        f" import os, sys; {code}"
    )
