"""Checks of incoming blocks: one scan, consecutive samples, finite values."""

from math import isfinite
from typing import Any, Protocol

import numpy as np

from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.types import AXES, Array, Trace

MAX_BLOCK = 10_000
"""Most samples that one message may carry."""


class ReceivedBlock(Protocol):
    """Fields that DisplacementBlock and VoltageBlock share."""

    scan_id: str
    first_sample: int
    sample_period: float
    x: Any
    y: Any
    last: bool


class BlockGuard:
    """Checks the blocks of one topic through one scan; refuses any that differs from the scan."""

    def __init__(self, topic: str, scan_id: str, sample_period: float, total_samples: int) -> None:
        self.topic = topic
        self.scan_id = scan_id
        self.sample_period = sample_period
        self.total_samples = total_samples
        self.next_sample = 0
        self.complete = False

    def accept(self, block: ReceivedBlock) -> Trace:
        """Return the samples of the block that follows on the one before.

        Raises ScanError naming the topic, the sample and what is wrong with it.
        """
        x, y = (np.asarray(samples, dtype=np.float64) for samples in (block.x, block.y))
        self._check_scan(block)
        self._check_size(x, y)
        self._check_place(block.first_sample, block.first_sample + len(x))
        self._check_numbers(x, y)
        self.next_sample += len(x)
        self.complete = block.last
        return Trace(block.first_sample, self.sample_period, x, y)

    def _check_scan(self, block: ReceivedBlock) -> None:
        if block.scan_id != self.scan_id:
            self._refuse(f"a block of scan '{block.scan_id}' came during scan '{self.scan_id}'")
        if block.sample_period != self.sample_period:
            self._refuse(
                f"the sample period changed from {self.sample_period:g} s to"
                f" {block.sample_period:g} s at sample {block.first_sample}"
            )

    def _check_size(self, x: Array, y: Array) -> None:
        if len(x) != len(y):
            self._refuse(f"sample {self.next_sample}: {len(x)} x values but {len(y)} y values")
        if not 0 < len(x) <= MAX_BLOCK:
            self._refuse(f"sample {self.next_sample}: {len(x)} samples, not 1 to {MAX_BLOCK}")

    def _check_place(self, first: int, end: int) -> None:
        if self.complete:
            self._refuse(f"a block at sample {first} came after the scan's last block")
        if first > self.next_sample:
            late = "" if self.next_sample else ", or this node came late"
            missing = f"samples {self.next_sample} to {first - 1} are missing"
            self._refuse(f"{missing}: a block was lost{late}")
        if first < self.next_sample:
            self._refuse(f"sample {first} came again, where {self.next_sample} was due")
        if end > self.total_samples:
            self._refuse(f"sample {end - 1} is beyond the {self.total_samples} of the scan")

    def _check_numbers(self, x: Array, y: Array) -> None:
        if isfinite(np.vdot(x, y)):  # one number that is not finite spoils it, whatever the rest
            return
        for axis, samples in zip(AXES, (x, y), strict=True):
            for place in np.flatnonzero(~np.isfinite(samples)):
                where = f"sample {self.next_sample + place}, {axis}"
                self._refuse(f"{where}: {samples[place]} is not a finite number")

    def _refuse(self, why: str) -> None:
        raise ScanError(f"{self.topic}: {why}")
