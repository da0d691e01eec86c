"""A scan with line-to-line feedback within one process: the nodes' core and simulated scanner."""

from collections import deque
from collections.abc import Iterable

import numpy as np

from afm_scan_bench.scans import ALL, SEED, default_model
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, end
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.features.online.line_correction import lines_of_delay
from afm_scan_ros.features.online.line_feedback import FedBack
from afm_scan_ros.nodes.parameters import block_size_at
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec


def fed_back_scan(
    spec: ScanSpec,
    plant: PlantSpec,
    *,
    age: float = 0.0,
    block_size: int = 0,
    corrects: bool = True,
) -> Scan:
    """Scan a plant of some age (s) with the default model, and line feedback if it ``corrects``.

    ``block_size`` is of the desired displacement, as the nodes': 0 for their default.
    """
    period, total = spec.sample_period, total_samples(spec)
    limits = plant.amplifier.limits
    compensation = Compensation(default_model(), period, ALL, InverseSettings(), limits)
    chain = _Chain(compensation, Piezoscanner(plant, period, SEED, age), total)
    delay = lines_of_delay(spec, compensation.held_back)
    fed_back = FedBack(spec, delay) if corrects else None
    size = block_size or block_size_at(period)
    for first in range(0, total, size):
        block = desired(spec, first, min(size, total - first))
        if fed_back is not None:
            fed_back.observe(DESIRED, block)
        chain.follow([block] if fed_back is None else fed_back.corrected([block]), fed_back)
    return Scan(spec, desired(spec, 0, total), *chain.signals())


class _Chain:
    """The compensation and the scanner, each with its state."""

    def __init__(self, compensation: Compensation, scanner: Piezoscanner, total: int) -> None:
        self._compensation, self._scanner, self._total = compensation, scanner, total
        self._progress = compensation.at_rest()
        self._made: list[tuple[Trace, Trace, Trace]] = []

    def follow(self, blocks: Iterable[Trace], fed_back: FedBack | None) -> None:
        """Follow blocks, and what feedback lets go on by what was achieved."""
        waiting = deque(blocks)
        while waiting:
            drive = self._drive(waiting.popleft())
            if not drive.x.size:
                continue
            measured, true = self._scanner.advance(drive)
            self._made.append((drive, measured, true))
            if fed_back is not None:
                fed_back.observe(ACHIEVED, measured)
                waiting.extend(fed_back.corrected())

    def signals(self) -> list[Trace]:
        """Return drive, measured and true displacement."""
        return [_joined(blocks) for blocks in zip(*self._made, strict=True)]

    def _drive(self, block: Trace) -> Trace:
        self._progress, drive = self._compensation.invert(self._progress, block)
        if end(block) < self._total:
            return drive
        return _joined([drive, self._compensation.finish(self._progress)])


def _joined(blocks: Iterable[Trace]) -> Trace:
    first, *rest = blocks
    x, y = (np.concatenate([each.axis(name) for each in (first, *rest)]) for name in AXES)
    return Trace(first.first_sample, first.sample_period, x, y)
