"""What a bag states of its scan, and its blocks of samples, verified."""

from contextlib import suppress
from math import inf, isclose, isfinite
from typing import Any

import numpy as np
from attrs import asdict, define, field, frozen
from numpy.typing import NDArray

from afm_scan_ros.bag import typestore
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec, scan_parameters
from afm_scan_ros.core.streams import LineError, MonitorSample
from afm_scan_ros.core.trajectory import total_samples
from afm_scan_ros.core.types import AXES, Trace

TYPE = f"{typestore.PACKAGE}/ScanInfo"
INSTANTS = ("before_update", "after_update")
"""When a sample is taken, seen from the converter's update."""
SHORTEST, LONGEST = 1e-9, 2**63 * 1e-9
"""Least sample period and longest scan, s: stamps count ns in 64 bits."""
ROUNDING = 1e-9
"""Share by which a period may differ from that of the lines: it is computed in another way."""
LARGEST = 1e30
"""No length and no voltage, in m and V: the universe is smaller."""


def info_fields(info: ScanInfo) -> dict[str, Any]:
    """Return the fields of ``ScanInfo.msg`` but for its header."""
    unset: dict[str, Any] = {a.name: a.type() if a.type else None for a in scan_parameters()}
    fields = unset if info.spec is None else asdict(info.spec)
    own = asdict(info, filter=lambda a, _: a.name not in ("start", "spec"))
    lists = {"inverses": list(info.inverses), "nodes": list(info.nodes)}
    return {**fields, **own, **lists}


def info_from_message(message: typestore.Message) -> ScanInfo:
    """Read a ``ScanInfo`` message.

    Raises InputError where it contradicts itself, or states what cannot be.
    """
    spec = None
    if message.pattern in PATTERNS:
        try:
            spec = ScanSpec(**{a.name: getattr(message, a.name) for a in scan_parameters()})
        except ValueError as error:
            raise InputError(f"scan_info: {error}") from error
    info = ScanInfo(
        scan_id=message.scan_id,
        start=typestore.stamp_of(message),
        pattern=message.pattern,
        sample_period=float(message.sample_period),
        total_samples=int(message.total_samples),
        spec=spec,
        inverses=tuple(message.inverses),
        model_hash=message.model_hash,
        sampling_instant=message.sampling_instant,
        trigger_offset=float(message.trigger_offset),
        window=int(message.window),
        nodes=tuple(message.nodes),
    )
    if fault := _contradiction(info, described=message.lines > 0 and message.range_x > 0.0):
        raise InputError(f"scan_info: {fault}")
    return info


def _contradiction(info: ScanInfo, *, described: bool) -> str:
    """Say what cannot be; ``described`` is whether lines and a range are stated."""
    period, total = info.sample_period, info.total_samples
    if not SHORTEST <= period < inf:
        return f"sample_period = {period:g}: give a time in s, {SHORTEST:g} at least"
    if not 0 < total * period < LONGEST:
        return f"total_samples = {total}: give 1 at least, and {LONGEST:g} s of them at most"
    if info.sampling_instant not in INSTANTS or not isfinite(info.trigger_offset):
        stated = f"sampling_instant = '{info.sampling_instant}', {info.trigger_offset:g} s"
        return f"{stated}: give {' or '.join(INSTANTS)}, and the trigger's offset"
    if info.spec is not None:
        return _other_scan(info, info.spec)
    known = f"pattern = '{info.pattern}' has lines: give one of {', '.join(PATTERNS)}"
    return known if described else ""


def _other_scan(info: ScanInfo, spec: ScanSpec) -> str:
    """Say where the samples are not those of the scan that is described."""
    period, total = info.sample_period, info.total_samples
    if not isclose(period, spec.sample_period, rel_tol=ROUNDING):
        made = f"{spec.line_rate:g} lines/s of {spec.samples_per_line} samples"
        return f"sample_period = {period:g} s, but {made} make {spec.sample_period:g} s"
    if total != (expected := total_samples(spec)):
        return (
            f"total_samples = {total}, but its lines and what is before and after make {expected}"
        )
    return ""


def encode_info(info: ScanInfo) -> bytes:
    """CDR of the ``ScanInfo`` message."""
    return typestore.encode(TYPE, info.start, info_fields(info))


def decode_info(cdr: bytes) -> ScanInfo:
    """Read a ``ScanInfo`` from its CDR, also one that ends before the centre, which is 0 then.

    Raises InputError where it is not one.
    """
    try:
        message = _message(cdr)
    except ValueError as error:
        raise InputError(f"scan_info: {error}") from error
    return info_from_message(message)


def _message(cdr: bytes) -> typestore.Message:
    """Decode a message; the centre is two numbers at its end, each at a multiple of their size."""
    with suppress(ValueError):
        return typestore.decode(TYPE, cdr)
    size = np.dtype(np.float64).itemsize
    return typestore.decode(
        TYPE, cdr + bytes(-(len(cdr) - typestore.ENCODING_SIZE) % size + 2 * size)
    )


DISPLACEMENT = f"{typestore.PACKAGE}/DisplacementBlock"
VOLTAGE = f"{typestore.PACKAGE}/VoltageBlock"

STREAMS = {
    "desired_displacement": DISPLACEMENT,
    "drive_voltage": VOLTAGE,
    "achieved_displacement": DISPLACEMENT,
    "true_displacement": DISPLACEMENT,
}


LINE_FIGURES = ("tracking_error", "model_residual")
"""Topics with the figures of each line."""
MONITOR = "monitor"
"""Topic with single samples."""
LINE, SAMPLE = f"{typestore.PACKAGE}/TrackingError", f"{typestore.PACKAGE}/MonitorSample"


def encode_line(info: ScanInfo, figures: LineError) -> bytes:
    """CDR of the ``TrackingError`` message of one line."""
    figures_of_line = asdict(figures, filter=lambda a, _: a.name != "first_sample")
    fields = {"scan_id": info.scan_id, **figures_of_line}
    return typestore.encode(LINE, info.stamp(figures.first_sample), fields)


def encode_sample(info: ScanInfo, sample: MonitorSample) -> bytes:
    """CDR of the ``MonitorSample`` message."""
    fields = {"scan_id": info.scan_id, **asdict(sample)}
    return typestore.encode(SAMPLE, info.stamp(sample.sample), fields)


@frozen(eq=False)
class Block:
    """One message of a stream of samples."""

    scan_id: str
    trace: Trace
    last: bool


def encode_block(type_name: str, info: ScanInfo, trace: Trace, *, last: bool) -> bytes:
    """CDR of the message that carries a trace (displacements in m, or volts)."""
    fields = {
        "scan_id": info.scan_id,
        "first_sample": trace.first_sample,
        "sample_period": trace.sample_period,
        "x": np.ascontiguousarray(trace.x),
        "y": np.ascontiguousarray(trace.y),
        "last": last,
    }
    return typestore.encode(type_name, info.stamp(trace.first_sample), fields)


def decode_block(type_name: str, cdr: bytes) -> Block:
    """Block of samples from its CDR; raises ValueError where it is not one.

    The samples are copied, for compiled loops take arrays that can be written.
    """
    message = typestore.decode(type_name, cdr)
    trace = Trace(
        int(message.first_sample),
        float(message.sample_period),
        np.array(message.x, dtype=np.float64),
        np.array(message.y, dtype=np.float64),
    )
    return Block(message.scan_id, trace, bool(message.last))


def info_of_block(type_name: str, cdr: bytes) -> ScanInfo:
    """Return what a block states of its record, which states no length: 0 samples are announced.

    Raises ValueError where it is not one.
    """
    block = decode_block(type_name, cdr)
    stamp = typestore.stamp_of(typestore.decode(type_name, cdr))
    period = block.trace.sample_period
    before = round(block.trace.first_sample * period * 1e9)
    return ScanInfo(block.scan_id, stamp - before, "recording", period, total_samples=0)


@define
class BlockDecoder:
    """Decodes the messages of one topic; the layout of one serves for those behind it."""

    type_name: str
    _layout: typestore.MessageLayout | None = field(default=None, init=False)

    def together(self, cdrs: NDArray[np.uint8]) -> Block | None:
        """Blocks of samples that follow each other, as one; their CDRs are ``cdrs`` (n, size).

        None where they do not, or where one alone shows what is wrong with it.
        """
        table = None if self._layout is None else self._layout.table(cdrs)
        if table is None:
            try:
                self._layout = typestore.layout_of(self.type_name, cdrs[0])
            except ValueError:
                return None
            table = self._layout.table(cdrs)
        if table is None or not _follow(table):
            return None
        x, y = (table[axis].copy().ravel() for axis in AXES)
        first, period = int(table["first_sample"][0]), float(table["sample_period"][0])
        scan_id = table["scan_id"][0].tobytes().decode()
        return Block(scan_id, Trace(first, period, x, y), bool(table["last"][-1]))


def _follow(table: NDArray[np.void]) -> bool:
    """Return whether each block begins where the one before it ends, and only the last is the last.

    Lists, as numpy takes longer for a few.
    """
    names = ("first_sample", "sample_period", "last")
    firsts, periods, lasts = (table[name].tolist() for name in names)
    sizes = {table[axis].shape[1] for axis in AXES}
    if len(sizes) > 1 or (size := sizes.pop()) == 0:
        return False
    expected = range(firsts[0], firsts[0] + size * len(firsts), size)
    return firsts == [*expected] and len({*periods}) == 1 and not any(lasts[:-1])


@define
class Continuity:
    """Sees that the blocks of one topic follow each other without gap, repeat or NaN.

    ``where`` names bag and topic in messages. After each block, ``next_sample`` is the first one
    not seen yet, and ``finished`` is whether the block was marked as the last. Where it is
    None at first, the blocks may begin at any sample.
    """

    where: str
    info: ScanInfo
    next_sample: int | None = 0
    finished: bool = False

    def check(self, block: Block) -> Trace:
        """Return the block's trace; raises InputError naming topic, sample and mend."""
        if self.next_sample is None:
            self.next_sample = block.trace.first_sample
        fault = self._fault(block, self.next_sample) or _bad_sample(block.trace)
        if fault:
            raise InputError(f"{self.where}: {fault}")
        self.next_sample += block.trace.x.size
        self.finished = block.last
        return block.trace

    def _fault(self, block: Block, expected: int) -> str:
        trace = block.trace
        if block.scan_id != self.info.scan_id:
            return (
                f"sample {trace.first_sample} is of scan '{block.scan_id}', not"
                f" '{self.info.scan_id}': record one scan a bag"
            )
        if trace.sample_period != self.info.sample_period:
            return (
                f"the sample period changes to {trace.sample_period:g} s at sample {expected},"
                f" from {self.info.sample_period:g} s: record at one sample period a bag"
            )
        if trace.first_sample > expected:
            return (
                f"samples {expected} to {trace.first_sample - 1} are missing:"
                " record with a keep-all subscription (config/record_qos.yaml)"
            )
        if trace.first_sample < expected or self.finished:
            return (
                f"sample {trace.first_sample} comes again, after sample {expected - 1}:"
                " see that one node alone publishes this topic"
            )
        if self.info.total_samples and expected + trace.x.size > self.info.total_samples:
            return (
                f"samples {expected} to {expected + trace.x.size - 1} are more than the"
                f" {self.info.total_samples} that scan_info announces: record one scan a bag"
            )
        return ""


def _bad_sample(trace: Trace) -> str:
    if trace.x.shape != trace.y.shape:
        return f"at sample {trace.first_sample} x has {trace.x.size} samples, y {trace.y.size}"
    for axis in AXES:
        samples = trace.axis(axis)
        if samples.dot(samples) < LARGEST**2:  # each of them is below
            continue
        bad = np.flatnonzero(~(np.abs(samples) < LARGEST))
        if bad.size:
            value = samples[bad[0]]
            return f"{axis} is {value} at sample {trace.first_sample + bad[0]}"
    return ""
