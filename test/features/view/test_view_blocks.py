"""What is shown of blocks is true of the scan, whichever blocks are missing."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import (
    ACHIEVED,
    DESIRED,
    DRIVE,
    LineError,
    LineErrors,
    end,
    monitor_step,
    part,
)
from afm_scan_ros.core.trajectory import desired, phases, total_samples
from afm_scan_ros.core.types import Array, Trace

pytest.importorskip("rerun", reason="the viewer is not installed: pip install 'afm_scan_ros[view]'")

from afm_scan_ros.features.view.blocks import ShownBlocks
from afm_scan_ros.features.view.screen import ERROR

SPEC = ScanSpec(lines=6, line_rate=100.0, samples_per_line=500, turnaround=0.2, preparation="none")
TOTAL, STEP = total_samples(SPEC), monitor_step(SPEC.sample_period)
SIZE = 350
NOISE = np.random.default_rng(1).normal(0.0, 1e-8, (2, TOTAL))
WANTED = desired(SPEC, 0, TOTAL)
STREAMS = {
    DESIRED: WANTED,
    DRIVE: Trace(0, SPEC.sample_period, *NOISE),
    ACHIEVED: Trace(0, SPEC.sample_period, WANTED.x + NOISE[0], WANTED.y + NOISE[1]),
}
BLOCKS = [
    (name, part(trace, first, min(first + SIZE, TOTAL)))
    for first in range(0, TOTAL, SIZE)
    for name, trace in STREAMS.items()
]


class Shown:
    """Keeps what a screen is to show."""

    def __init__(self, info: ScanInfo) -> None:
        self.info = info
        self.curves: dict[str, dict[int, tuple[float, float]]] = {}
        self.lines: dict[int, LineError] = {}
        self.images: dict[str, Array] = {}

    def curve(self, name: str, samples: Array, x: Array, y: Array) -> None:
        pairs = zip(samples.tolist(), zip(x.tolist(), y.tolist(), strict=True), strict=True)
        self.curves.setdefault(name, {}).update(pairs)

    def line(self, _: str, figures: LineError) -> None:
        self.lines[figures.line] = figures

    def image(self, name: str, values: Array) -> None:
        self.images[name] = values.copy()


def shown(blocks: Sequence[tuple[str, Trace]], info: ScanInfo | None = None) -> Shown:
    found = Shown(info or info_of_scan(SPEC, "one", 0))
    taken = ShownBlocks(found, 64)  # type: ignore[arg-type]
    for name, block in blocks:
        taken.add(name, block)
    return found


def true_lines() -> dict[int, LineError]:
    errors = LineErrors(phases(SPEC).lines, SPEC.samples_per_line)
    return {line.line: line for name, b in BLOCKS if name != DRIVE for line in errors.add(name, b)}


def test_without_gaps_every_line_and_every_step_is_shown() -> None:
    found = shown(BLOCKS)
    assert found.lines == true_lines()
    assert sorted(found.curves) == sorted([DESIRED, DRIVE, ACHIEVED, ERROR])
    for curve in found.curves.values():
        assert list(curve) == list(range(0, TOTAL, STEP))
    assert np.isfinite(found.images["error_x"]).all()
    assert np.abs(found.images["error_x"]).max() < 1e-7  # of noise of 10 nm


@given(st.sets(st.integers(0, len(BLOCKS) - 1)))
@settings(max_examples=200)
def test_with_gaps_whatever_is_shown_is_true(missing: set[int]) -> None:
    found = shown([block for number, block in enumerate(BLOCKS) if number not in missing])
    truth = true_lines()
    for number, line in found.lines.items():
        assert line == truth[number]
    whole = {**STREAMS, ERROR: Trace(0, SPEC.sample_period, *(NOISE))}
    for name, curve in found.curves.items():
        for sample, (x, y) in curve.items():
            if name == ERROR:
                got, wanted = STREAMS[ACHIEVED], STREAMS[DESIRED]
                assert (x, y) == (
                    got.x[sample] - wanted.x[sample],
                    got.y[sample] - wanted.y[sample],
                )
            else:
                assert (x, y) == (whole[name].x[sample], whole[name].y[sample])
    rows = found.images.get("error_x", np.empty((0, 64)))
    for number, row in enumerate(rows):
        assert np.isfinite(row).all() == (number in found.lines)


@given(st.integers(0, len(BLOCKS) // 2))
def test_after_a_gap_the_lines_from_the_next_one_on_are_shown(lost: int) -> None:
    found = shown(BLOCKS[lost:])
    begins = max(end(block) for _, block in BLOCKS[lost : lost + len(STREAMS)])
    later = [n for n, line in true_lines().items() if line.first_sample >= begins]
    assert set(later) <= set(found.lines)


def test_a_record_without_lines_has_curves_alone() -> None:
    info = ScanInfo("one", 0, "creep", SPEC.sample_period, TOTAL)
    found = shown(BLOCKS, info)
    assert found.lines == {}
    assert found.images == {}
    assert len(found.curves[ERROR]) == len(range(0, TOTAL, STEP))
