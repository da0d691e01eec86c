"""Whether a sample costs the same however long the record, and however much is remembered."""

from collections.abc import Iterator

import numpy as np

from afm_scan_bench.scans import default_model
from afm_scan_bench.speed.timing.chain import BLOCK, chain_of_inverses, long_scan, stream
from afm_scan_bench.speed.timing.race import Task, race
from afm_scan_ros.core.compensation import Compensation, Progress
from afm_scan_ros.core.effects.hysteresis.preisach import Memory, Preisach
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row

SHORT = 10_000
AT_ONCE = 50_000


def rows(lengths: tuple[int, ...], loops: int, turns: int) -> Iterator[Row]:
    """Race records grown to ``lengths``, and a memory with so many nested ``loops``."""
    yield from _longer(lengths, turns)
    hysteresis, small = Preisach(default_model().axis("x").hysteresis.surface), wobble()
    empty, full = hysteresis.saturated(), nested(hysteresis, loops)
    yield race(
        f"hysteresis with {loops:,} nested loops remembered, blocks of {BLOCK}",
        Task(lambda: in_blocks(hysteresis, full, small), len(small)),
        "with none",
        Task(lambda: in_blocks(hysteresis, empty, small), len(small)),
        "≤ 1.3",
        turns,
    )


def _longer(lengths: tuple[int, ...], turns: int) -> Iterator[Row]:
    chain = chain_of_inverses()
    first = stream(chain, chain.at_rest(), desired(long_scan(), 0, SHORT), BLOCK)
    progress, done = first, SHORT
    for length in lengths:
        progress, done = _grown(chain, progress, done, length), length
        name = f"all inverses as a stream at sample {length:,}"
        ours, theirs = _from(chain, progress, length), _from(chain, first, SHORT)
        yield race(name, ours, f"at sample {SHORT:,}", theirs, "≤ 1.3", turns)


def _from(chain: Compensation, progress: Progress, sample: int) -> Task:
    part = desired(long_scan(), sample, SHORT)
    return Task(lambda: stream(chain, progress, part, BLOCK), SHORT)


def _grown(chain: Compensation, progress: Progress, done: int, length: int) -> Progress:
    for start in range(done, length, AT_ONCE):
        part = desired(long_scan(), start, min(AT_ONCE, length - start))
        progress = stream(chain, progress, part, AT_ONCE)
    return progress


def nested(hysteresis: Preisach, loops: int) -> Memory:
    """Memory after so many loops, each within the one before, down to some tenths of a volt."""
    within = np.outer(
        np.linspace(1.0, 0.1, loops), [hysteresis.surface.upper, hysteresis.surface.lower]
    )
    return hysteresis.apply(hysteresis.saturated(), within.ravel())[0]


def wobble() -> Array:
    """Drive (V) of small loops that never leave the innermost."""
    return np.tile([0.3, -0.3, 0.2, -0.2, 0.1], 10_000)


def in_blocks(hysteresis: Preisach, memory: Memory, drive: Array) -> Memory:
    """Memory after a drive in blocks."""
    for first in range(0, len(drive), BLOCK):
        memory, _ = hysteresis.apply(memory, drive[first : first + BLOCK])
    return memory
