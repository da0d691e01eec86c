"""Scans with a view, as commands of their own, and what the view's file shows of them."""

import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.core.types import AXES, Array

COMMAND = "from afm_scan_ros.cli.main import main; main()"
WITHOUT_ROS = f"import sys; sys.modules['rclpy'] = None; {COMMAND}"
FEEDER = "afm_scan_ros.features.view.process"
STREAMS = (
    "desired_displacement",
    "drive_voltage",
    "achieved_displacement",
    "true_displacement",
)


def command(*arguments: object, code: str = WITHOUT_ROS) -> "subprocess.Popen[str]":
    """Start ``afm-scan`` with arguments."""
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def feeder_of(scan: int) -> int:
    """Return the process that feeds the viewer, of those that a scan has started."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            parent = stat.read_text("utf-8").rpartition(")")[2].split()[1]
            if int(parent) == scan and FEEDER in (stat.parent / "cmdline").read_text("utf-8"):
                return int(stat.parent.name)
    raise LookupError("the scan has no process that feeds the viewer")


def let_go_on(pid: int) -> None:
    """Let a process that was stopped go on; one that is gone stays gone."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)


def recorded(bag: Path) -> Array:
    """Return all samples of a bag that nothing is missing in, (streams, axes, n)."""
    recording = read_scan(bag)
    assert recording.warnings == ()
    traces = [recording.whole(name) for name in STREAMS]
    assert recording.missing(traces[0].x.size) == 0
    return np.stack([[trace.axis(axis) for axis in AXES] for trace in traces])


def curve(file: Path, path: str) -> tuple[Array, Array]:
    """Return times (s) and values of a curve in a file of the viewer."""
    import rerun as rr  # noqa: PLC0415 - need not be installed

    view = rr.dataframe.load_recording(file).view(index="scan_time", contents=path)
    table = view.select("scan_time", f"{path}:Scalar").read_all()
    rows = [(t, v[0]) for t, v in zip(*(c.to_pylist() for c in table.columns), strict=True) if v]
    times = np.array([time.value for time, _ in rows]) * 1e-9
    return times, np.array([value for _, value in rows])


def news(file: Path) -> list[str]:
    """Return the news in a file of the viewer."""
    import rerun as rr  # noqa: PLC0415 - need not be installed

    view = rr.dataframe.load_recording(file).view(index="log_time", contents="/news")
    return [text[0] for text in view.select("/news:Text").read_all()[0].to_pylist() if text]


def states(file: Path) -> str:
    """Return the table of states in a file of the viewer, as it was last."""
    import rerun as rr  # noqa: PLC0415 - need not be installed

    view = rr.dataframe.load_recording(file).view(
        index="scan_time", contents="/states", include_semantically_empty_columns=True
    )
    text: str = view.select_static("/states:Text").read_all()[0].to_pylist()[0][0]
    return text
