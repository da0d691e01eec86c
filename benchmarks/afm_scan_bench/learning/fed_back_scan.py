"""A scan with line-to-line feedback within one process: the nodes' core and simulated scanner."""

from collections import deque

import numpy as np

from afm_scan_bench.scans import ALL, SEED, default_model
from afm_scan_ros.core.align import end
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.learning.fed_back import FedBack
from afm_scan_ros.core.learning.line_feedback import LineFeedback, lines_of_delay
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.nodes.block_source import block_size_at
from afm_scan_ros.simulation.scanner import Piezoscanner
from afm_scan_ros.simulation.spec import PlantSpec


def fed_back_scan(
    spec: ScanSpec, plant: PlantSpec, seed: int = SEED, age: float = 0.0, block_size: int = 0
) -> Scan:
    """Scan a plant of some age (s), with the default model and line feedback.

    ``block_size`` is of the desired displacement, as the nodes': 0 for their default.
    """
    limits = plant.amplifier.limits
    compensation = Compensation(default_model(), spec.sample_period, ALL, InverseSettings(), limits)
    run = _Run(spec, compensation, Piezoscanner(plant, spec.sample_period, seed, age))
    total, size = total_samples(spec), block_size or block_size_at(spec.sample_period)
    for first in range(0, total, size):
        run.follow(desired(spec, first, min(size, total - first)), total)
    return Scan(spec, desired(spec, 0, total), *run.signals())


class _Run:
    """The compensation and the scanner, each with its state."""

    def __init__(self, spec: ScanSpec, compensation: Compensation, scanner: Piezoscanner) -> None:
        delay = lines_of_delay(spec, compensation.held_back)
        self._fed_back = FedBack(spec, LineFeedback(spec, delay))
        self._compensation, self._scanner = compensation, scanner
        self._progress = compensation.at_rest()
        self._made: list[tuple[Trace, Trace, Trace]] = []

    def follow(self, block: Trace, total: int) -> None:
        """Follow what can be followed by now."""
        waiting = deque(self._fed_back.desired(block, block))
        while waiting:
            drive = self._drive(waiting.popleft(), total)
            if drive.x.size:
                measured, true = self._scanner.advance(drive)
                self._made.append((drive, measured, true))
                waiting.extend(self._fed_back.achieved(measured))

    def signals(self) -> list[Trace]:
        """Return drive, measured and true displacement."""
        period = self._made[0][0].sample_period
        return [
            Trace(
                0, period, *(np.concatenate([each.axis(name) for each in blocks]) for name in AXES)
            )
            for blocks in zip(*self._made, strict=True)
        ]

    def _drive(self, block: Trace, total: int) -> Trace:
        self._progress, drive = self._compensation.invert(self._progress, block)
        if end(block) < total:
            return drive
        owed = self._compensation.finish(self._progress)
        x, y = np.append(drive.x, owed.x), np.append(drive.y, owed.y)
        return Trace(drive.first_sample, drive.sample_period, x, y)
