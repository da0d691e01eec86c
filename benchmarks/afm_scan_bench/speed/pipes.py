"""How fast a scan goes through its nodes, and how fast plain nodes pass on its blocks."""

import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader

from afm_scan_bench.curve import TableCurve
from afm_scan_ros.cli.processes import NodeCommand, isolate, run_nodes
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.nodes.topics import BLOCKS
from afm_scan_ros.report.table import Row, Table

RATE = 100_000
"""Samples a second, of each axis, that are real time."""
LINE = 4000  # samples
WINDOW = RATE  # samples in flight: a second, as at the 20 kHz of config/scan.yaml

SIZES = {100: 3000, 300: 3000, 1000: 2000, 2000: 1000, 3000: 600, 10_000: 200}
"""Blocks that are timed, by the samples in one."""
TURNS = 3

COLUMNS = {
    "block": ("block, samples", ",d"),
    "blocks_per_s": ("blocks/s", ".0f"),
    "real_time": ("of real time", ".1f"),
    "slowest": ("slowest", ".1f"),
    "fastest": ("fastest", ".1f"),
    "plain_per_s": ("plain rclpy nodes, blocks/s", ".0f"),
    "share": ("share of it", ".2f"),
    "lowest": ("lowest", ".2f"),
    "highest": ("highest", ".2f"),
}

PARTS = ("recorder", "scanner", "compensator", "source")
START = "from afm_scan_bench.speed.plain_rclpy import main; main({!r}, {}, {})"


def measure() -> Table:
    """Run the nodes and plain nodes by turns, for each size of block."""
    return table(SIZES, TURNS)


def table(sizes: Mapping[int, int], turns: int) -> Table:
    """Return the table of so many blocks of each size."""
    title = (
        f"Generator, compensator, simulated scanner and recorder as processes; real time is"
        f" {RATE:,d} samples/s in x and y (targets: 8 times with 2000, 20 times with 10000)"
    )
    rows = [_row(size, blocks, turns) for size, blocks in sizes.items()]
    curve = TableCurve("block", "real_time", logarithmic=True)
    return Table("pipes", title, COLUMNS, rows, curve.picture(title, COLUMNS, rows))


def _row(size: int, blocks: int, turns: int) -> Row:
    rates = np.array([(nodes_rate(size, blocks), plain_rate(size, blocks)) for _ in range(turns)])
    nodes, shares = rates[:, 0], rates[:, 0] / rates[:, 1]
    times = nodes * size / RATE
    return {
        "block": size,
        "blocks_per_s": float(np.median(nodes)),
        "real_time": float(np.median(times)),
        "slowest": float(times.min()),
        "fastest": float(times.max()),
        "plain_per_s": float(np.median(rates[:, 1])),
        "share": float(np.median(shares)),
        "lowest": float(shares.min()),
        "highest": float(shares.max()),
    }


def nodes_rate(size: int, blocks: int) -> float:
    """Blocks a second of a scan as fast as its nodes allow, from the recorder's first to last."""
    isolate()
    with TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        run_nodes(_commands(bag, size, blocks), lambda: time.sleep(0.02))
        return _recorded_rate(bag / "bag_0.mcap")


def plain_rate(size: int, blocks: int) -> float:
    """Blocks a second of plain nodes through the same hops.

    Raises ScanError, and ends the others, where a part of it ended badly.
    """
    isolate()
    running = [
        subprocess.Popen(  # noqa: S603 - our own interpreter and module
            [sys.executable, "-c", START.format(part, size, blocks)],
            stdout=subprocess.PIPE,
            text=True,
        )
        for part in PARTS
    ]
    _await(running)
    outputs = [process.communicate()[0] for process in running]
    return float(outputs[0])


def _await(running: Sequence["subprocess.Popen[str]"]) -> None:
    statuses: list[int | None] = [None]
    while None in statuses:
        time.sleep(0.02)
        statuses = [process.poll() for process in running]
        if any(statuses):
            for process in running:
                process.kill()
                process.communicate()
            raise ScanError(f"plain nodes: {dict(zip(PARTS, statuses, strict=True))}")


def _commands(bag: Path, size: int, blocks: int) -> list[NodeCommand]:
    scan = {
        "line_rate_hz": RATE / LINE,
        "samples_per_line": LINE,
        "lines": max(2, ceil(blocks * size / LINE)),
        "preparation_cycles": 1,
        "block_size": size,
        "window": WINDOW,
        "time_scale": 0.0,
        "required_nodes": ["inversion_compensator", "piezoscanner_sim", "scan_recorder"],
    }
    return [
        NodeCommand("scan_recorder", {"bag": str(bag)}),
        NodeCommand("piezoscanner_sim", {"min_subscriptions": 1}),
        NodeCommand("inversion_compensator", {"preflight_samples": 0}),
        NodeCommand("trajectory_generator", scan),
    ]


def _recorded_rate(file: Path) -> float:
    times, blocks = [], 0
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            if channel.topic.strip("/") in BLOCKS:
                times.append(message.log_time)
                blocks += channel.topic == "/achieved_displacement"
    return (blocks - 1) / (1e-9 * (times[-1] - times[0]))
