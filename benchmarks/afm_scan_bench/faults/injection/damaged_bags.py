"""Bytes of a bag that turn over, and bags that are cut: noticed by name, or without effect."""

import json
import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from attrs import define, field
from mcap.opcode import Opcode

from afm_scan_bench.faults.damage import Rng, cut, turned
from afm_scan_bench.faults.faults import Announce
from afm_scan_bench.faults.injection.bag import Undisturbed
from afm_scan_bench.faults.injection.outcome import LossError, ProcessEnd, Tally, command, damaged
from afm_scan_bench.scans import scan
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.main import BAD_INPUT, DOES_NOT_HOLD
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import part
from afm_scan_ros.report.table import Row

TRIALS = 1000
SPEC = ScanSpec(
    range_x=10e-6,
    range_y=10e-6,
    line_rate=4.0,
    lines=12,
    samples_per_line=100,
    y_step=10e-3,
    preparation_cycles=5,
)
"""A scan of four seconds, so that its bag has as many chunks."""
BLOCK = 50
_HEAD, _CHUNK_HEAD = struct.Struct("<BQ"), 40


@define
class Recorded:
    """The bag of a scan, what is in it, and where in its file no samples lie."""

    folder: Path
    figures: object = field(init=False)
    calm: Undisturbed = field(init=False)

    def __attrs_post_init__(self) -> None:
        _record(self.bag)
        command("analyze", self.bag, "--json", self._json)
        self.figures = self._figures()
        self.calm = Undisturbed(self.bag)

    @property
    def bag(self) -> Path:
        """The bag's folder."""
        return self.folder / "bag"

    @property
    def file(self) -> Path:
        """Its one MCAP file."""
        return self.bag / "bag_0.mcap"

    @property
    def metadata(self) -> Path:
        """What describes it."""
        return self.bag / "metadata.yaml"

    def analysed(self) -> str:
        """Return what became of the figures; raises LossError where they are others."""
        self._json.unlink(missing_ok=True)
        ended = command("analyze", self.bag, "--json", self._json)
        if ended.status == BAD_INPUT:
            raise InputError(ended.message)
        if ended.status == DOES_NOT_HOLD:
            return self._beginning(ended)
        if self._figures() != self.figures:
            raise LossError("other figures, silently")
        return "the same figures, with a warning" if ended.warnings else "the same figures"

    def _beginning(self, ended: ProcessEnd) -> str:
        """Return what became of a bag that is incomplete, whose samples are those of before."""
        if not ended.warnings or "the scan is incomplete" not in ended.message:
            raise LossError(f"no warning, but {ended.message}")
        try:
            self.calm.kept(self.bag)
        except InputError as error:
            raise LossError(str(error)) from error
        return "its beginning, named as such"

    @property
    def _json(self) -> Path:
        return self.folder / "figures.json"

    def _figures(self) -> object:
        figures = json.loads(self._json.read_text("utf-8"))
        del figures["warnings"]
        return figures


def inject(announce: Announce, trials: int = TRIALS) -> Iterator[Row]:
    """Damage a bag in as many ways, each time from its whole self."""
    rng = np.random.default_rng(1)
    with TemporaryDirectory() as folder:
        recorded = Recorded(Path(folder))
        beside = beside_samples(recorded.file.read_bytes())
        kinds: dict[str, tuple[Path, Callable[[bytes, Rng], bytes], float]] = {
            "a byte of a bag turns over": (recorded.file, turned, 0.3),
            "one beside its samples": (recorded.file, partial(turned, places=beside), 0.3),
            "one of its metadata.yaml": (recorded.metadata, turned, 0.15),
            "a bag is cut short": (recorded.file, cut, 0.15),
            "its metadata.yaml is": (recorded.metadata, cut, 0.1),
        }
        for fault, (path, damage, share) in kinds.items():
            announce(fault)
            tally = Tally()
            for _ in range(round(share * trials)):
                with damaged(path, damage(path.read_bytes(), rng)):
                    tally.judge(recorded.analysed, recorded.bag.name)
            yield tally.row(fault)


def beside_samples(content: bytes) -> list[int]:
    """Places in an MCAP file that lie in no chunk's records: heads, indices, summary, magic."""
    start, end = 8, len(content) - 8
    places = [*range(start), *range(end, len(content))]
    while start < end:
        opcode, length = _HEAD.unpack_from(content, start)
        kept = _CHUNK_HEAD if opcode == Opcode.CHUNK else length
        places += range(start, start + _HEAD.size + kept)
        start += _HEAD.size + length
    return places


def _record(bag: Path) -> None:
    done = scan(SPEC, ("creep", "hysteresis"))
    info = info_of_scan(SPEC, "scan", 10**18)
    streams = {
        "desired_displacement": done.desired,
        "drive_voltage": done.drive,
        "achieved_displacement": done.measured,
        "true_displacement": done.true,
    }
    with ScanWriter(bag, info) as writer:
        for first in range(0, info.total_samples, BLOCK):
            for name, trace in streams.items():
                writer.add(name, part(trace, first, min(first + BLOCK, info.total_samples)))
