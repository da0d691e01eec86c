"""A minute at 100 kHz in real time, each sample due by the clock of an emulated converter."""

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from afm_scan_bench.faults.injection.clocked_scanner import ClockedScanner
from afm_scan_bench.faults.injection.processes import NODES
from afm_scan_bench.faults.injection.trial import PATIENCE, Heard, Trial
from afm_scan_bench.faults.machine import load
from afm_scan_ros.bag.reader import ScanRecording, read_scan
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes.peers import RUNNING
from afm_scan_ros.nodes.topics import BLOCKS, TRUE
from afm_scan_ros.report.table import Row, Table

SECONDS = 60.0
RATE = 100_000
LINE_RATE = 20.0
BUFFER = 0.1
"""Seconds of drive before the converter, and so the latency of its readings."""
SOURCE, SCANNER = "trajectory_generator", "scanner_driver"
RECORDED = [name for name in BLOCKS if name != TRUE.name]
CHAIN = tuple(name.replace("piezoscanner_sim", SCANNER) for name in NODES)
SENSOR = (
    "{sensor_scale_m_per_v: 1.0, sensor_offset_v: 0.0, sensor_low_v: -1.0e-4,"
    " sensor_high_v: 1.0e-4}"
)
AMPLIFIER = "{voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}"
SETTINGS = f"""amplifier: {AMPLIFIER}
x: {SENSOR}
y: {SENSOR}
sampling_instant: before_update
latency_samples: {round(BUFFER * RATE)}
response_time_s: 0.02
drive_resolution_v: 10.0
options: {{report: {{report}}}}
"""

COLUMNS = {
    "rate_khz": ("rate, kHz", "g"),
    "seconds": ("duration, s", "g"),
    "samples": ("samples of x and y", ",d"),
    "underruns": ("underruns", "d"),
    "gaps": ("gaps", "d"),
    "buffer_ms": ("buffer, ms", ".0f"),
    "least_ms": ("least of it filled, ms", ".0f"),
    "latency_ms": ("from the source's start to the output, ms", ".0f"),
    "ended": ("ended", ""),
}


def measure(seconds: float = SECONDS) -> Table:
    """Scan so long with the driver's process on an emulated converter's clock, and record it."""
    with TemporaryDirectory() as folder, working("real_time"):
        measured = scan(Path(folder) / "scan", seconds)
    title = f"Five nodes and the driver's process in real time ({load()})"
    return Table("real_time", title, COLUMNS, [measured])


def scan(folder: Path, seconds: float) -> Row:
    """Make one scan; return what is known of it, also where it ended early.

    Raises ScanError where it did not begin.
    """
    report = folder / "report.json"
    driver = {
        "driver": f"{ClockedScanner.__module__}:{ClockedScanner.__name__}",
        "settings_file": str(folder / "settings.yaml"),
        "min_subscriptions": 2,
    }
    recorder = {"topics": RECORDED}
    given = {SOURCE: _spec(seconds), SCANNER: driver, "scan_recorder": recorder}
    with Trial(folder, **given) as trial:
        settings = SETTINGS.replace("{report}", str(report))
        (folder / "settings.yaml").write_text(settings, "utf-8")
        trial.start(*CHAIN)
        trial.until(lambda: None not in trial.statuses().values(), seconds + PATIENCE)
        failed = [node.message.strip() for node in trial.nodes.values() if node.status]
        trouble = "; ".join(message.rpartition("\n")[2] for message in failed)
        if not (trial.bag.exists() and report.exists()):
            raise ScanError(f"the scan did not begin: {trouble}")
        began = min(each.moment for each in trial.heard if _has_begun(each))
        return _row(trial.bag, report, seconds, trouble, began)


def _spec(seconds: float) -> Mapping[str, object]:
    """Return the scan, in blocks and with a window of the size that nobody states."""
    return {
        "line_rate_hz": LINE_RATE,
        "lines": round(seconds * LINE_RATE),
        "samples_per_line": round(RATE / LINE_RATE),
        "required_nodes": list(CHAIN[1:]),
        "block_size": 0,
        "window": 0,
    }


def _has_begun(heard: Heard) -> bool:
    return heard.node == SOURCE and heard.state == RUNNING


def _row(bag: Path, report: Path, seconds: float, trouble: str, began: float) -> Row:
    recording, said = read_scan(bag), json.loads(report.read_text("utf-8"))
    count, gaps = _samples(recording)
    return {
        "rate_khz": RATE / 1000,
        "seconds": seconds,
        "samples": count,
        "underruns": int("(underrun)" in trouble),
        "gaps": gaps,
        "buffer_ms": 1e3 * BUFFER,
        "least_ms": 1e3 * said["least_s"],
        "latency_ms": 1e3 * (said["first_output"] - began),
        "ended": trouble or "whole",
    }


def _samples(recording: ScanRecording) -> tuple[int, int]:
    """Count the samples that are in all streams of a bag, and the gaps: one ends the reading."""
    count = 0
    try:
        for blocks in recording.blocks(*RECORDED):
            count += len(blocks[0].x)
    except InputError:
        return count, 1
    return count, int(count != recording.info.total_samples)
