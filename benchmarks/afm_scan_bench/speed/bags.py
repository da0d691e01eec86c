"""How fast a scan is recorded and read back, beside the library that does nothing else."""

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from afm_scan_bench.speed.timing.ratios import COLUMNS, by_turns, row, seconds
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import STREAMS, encode_block
from afm_scan_ros.bag.writer import BagWriter, ScanWriter
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.report.table import Row, Table

BLOCK = 1000
PERIOD = 1e-5
BLOCKS = 1000
DECODED = 200
"""Blocks of a bag short enough for the general decoder."""
TURNS = 7


def measure() -> Table:
    """Record and read scans of four streams by turns with the library."""
    return table(BLOCKS, DECODED, TURNS)


def table(blocks: int, decoded: int, turns: int) -> Table:
    """Return the table for bags of so many blocks.

    Raises InputError where mcap-ros2-support is not installed.
    """
    if find_spec("mcap_ros2") is None:
        raise InputError("bench bags: needs mcap-ros2-support: pip install 'afm_scan_ros[test]'")
    with TemporaryDirectory() as folder:
        rows = [*_recording(Path(folder), blocks, turns), *_reading(Path(folder), blocks, turns)]
        rows.append(_decoding(Path(folder), decoded, turns))
    title = f"Bags of four streams in blocks of {BLOCK:,d} samples, x and y"
    return Table("bags", title, COLUMNS, rows)


def _recording(folder: Path, blocks: int, turns: int) -> list[Row]:
    info = _info(blocks)
    traces = [_trace(number) for number in range(blocks)]
    texts = {n: [encode_block(t, info, x, last=False) for x in traces] for n, t in STREAMS.items()}
    megabytes = sum(len(text) for stream in texts.values() for text in stream) / 1e6
    numbers = iter(range(10**6))

    def new() -> Path:
        return folder / f"bag{next(numbers)}"

    ours, arrays, theirs = by_turns(
        turns,
        seconds(lambda: _record(new(), texts)),
        seconds(lambda: _record_arrays(new(), info, traces)),
        seconds(lambda: _write(new(), texts)),
    )
    against = "mcap writing the same bytes"
    speeds = [[megabytes / each for each in times] for times in (ours, arrays, theirs)]
    return [
        row("recording messages", against, "MB/s", "≥ 0.7", speeds[0], speeds[2]),
        row("recording arrays", against, "MB/s", "≥ 0.7", speeds[1], speeds[2]),
    ]


def _reading(folder: Path, blocks: int, turns: int) -> list[Row]:
    bag, million = _bag(folder, blocks), len(STREAMS) * blocks * BLOCK / 1e6
    file = str(bag / "long_0.mcap")
    measures = (lambda: _arrays(bag), lambda: _raw(file), lambda: _raw(file, checked=True))
    speeds = [
        [million / each for each in times] for times in by_turns(turns, *map(seconds, measures))
    ]
    what, unit = "reading into arrays", "10⁶ samples/s"
    return [
        row(what, "mcap iterating the raw records", unit, "≥ 0.5", speeds[0], speeds[1]),
        row(what, "the same with its checksums", unit, "", speeds[0], speeds[2]),
    ]


def _decoding(folder: Path, blocks: int, turns: int) -> Row:
    bag, million = _bag(folder, blocks), len(STREAMS) * blocks * BLOCK / 1e6
    file = str(bag / "long_0.mcap")
    ours, theirs = by_turns(turns, seconds(lambda: _arrays(bag)), seconds(lambda: _decoded(file)))
    return row(
        f"reading into arrays, {blocks} blocks",
        "mcap-ros2-support decoding it",
        "10⁶ samples/s",
        "≥ 10",
        [million / each for each in ours],
        [million / each for each in theirs],
    )


def _info(blocks: int) -> ScanInfo:
    return ScanInfo("20260101T000000.000000Z", 0, "noise", PERIOD, blocks * BLOCK)


def _trace(number: int) -> Trace:
    rng = np.random.default_rng(number)
    return Trace(number * BLOCK, PERIOD, rng.random(BLOCK), rng.random(BLOCK))


def _bag(folder: Path, blocks: int) -> Path:
    bag = folder / f"of{blocks}" / "long"
    _record_arrays(bag, _info(blocks), [_trace(number) for number in range(blocks)])
    return bag


def _record(bag: Path, texts: dict[str, list[bytes]]) -> None:
    with BagWriter(bag) as writer:
        for name, kind in STREAMS.items():
            writer.add_topic(f"/{name}", kind)
        for number, together in enumerate(zip(*texts.values(), strict=True)):
            for name, text in zip(texts, together, strict=True):
                writer.write(f"/{name}", number, text)


def _record_arrays(bag: Path, info: ScanInfo, traces: list[Trace]) -> None:
    with ScanWriter(bag, info) as writer:
        for trace in traces:
            for name in STREAMS:
                writer.add(name, trace)


def _write(file: Path, texts: dict[str, list[bytes]]) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        schema = writer.register_schema("block", "ros2msg", b"")
        channels = [writer.register_channel(name, "cdr", schema) for name in texts]
        for number, together in enumerate(zip(*texts.values(), strict=True)):
            for channel, text in zip(channels, together, strict=True):
                writer.add_message(channel, number, text, number)
        writer.finish()


def _arrays(bag: Path) -> None:
    read_scan(bag).together(*STREAMS)


def _raw(file: str, *, checked: bool = False) -> None:
    with Path(file).open("rb") as stream:
        for _ in make_reader(stream, validate_crcs=checked).iter_messages():
            pass


def _decoded(file: str) -> None:
    from mcap_ros2.reader import read_ros2_messages  # noqa: PLC0415 - not always installed

    for each in read_ros2_messages(file):
        _ = each.ros_msg
