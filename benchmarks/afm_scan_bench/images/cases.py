"""A drawn case: scanner, grating and frames, one after another on the same scanner."""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.any_lab.scanner import FAMILIES
from afm_scan_bench.images.acquire import Acquired, Frame, acquire, approached
from afm_scan_bench.images.detection import Detection, drawn_detection
from afm_scan_bench.images.gratings import KINDS, CellGrating, drawn_grating
from afm_scan_bench.images.tube_scanner import TubeScanner, draw_tube

PITCHES = (0.5e-6, 1e-6, 2e-6, 3e-6, 5e-6, 10e-6)
"""Pitches (m) that gratings are sold with."""
EARLIER = 16
"""Lines of an earlier scan, which half of the scanners made."""
SMALLEST = 4.0
"""Periods over the commanded range of a smaller frame."""
PERIODS = (5.0, 12.0)
"""Fewest and most periods over the commanded range."""


@frozen(eq=False)
class Case:
    """A scanner over a grating, and what it is told.

    It waits for ``wait`` (s) before each frame. Before the first one it scanned ``earlier`` lines,
    the other way.
    """

    scanner: TubeScanner
    grating: CellGrating
    detection: Detection
    frame: Frame
    wait: float
    earlier: int
    seed: int

    def images(self, frames: Sequence[Frame]) -> Iterator[Acquired]:
        """Take the frames one after another, from rest on, each after a way of a second."""
        rng = np.random.default_rng((self.seed, 1))
        state, place = self.scanner.at_rest(), np.zeros(2)
        before = [evolve(self.downward(), lines=self.earlier)] if self.earlier else []
        for number, frame in enumerate([*before, *frames]):
            state = approached(self.scanner, state, frame, place, self.wait)
            taken = acquire(self.scanner, state, frame, self.grating, self.detection, rng)
            state = taken.after
            place = np.array(
                [-frame.range_x * (0.5 + frame.overscan), frame.level(frame.lines - 1)]
            )
            if number >= len(before):
                yield taken

    def faster(self, line_rate: float) -> Frame:
        """Return the case's frame at another line rate (Hz)."""
        return evolve(self.frame, line_time=1.0 / line_rate)

    def half(self) -> Frame:
        """Return the case's frame half as large, or of four cells where that is more."""
        share = max(0.5, SMALLEST * self.grating.pitch / self.frame.range_x)
        range_x, range_y = share * self.frame.range_x, share * self.frame.range_y
        return evolve(self.frame, range_x=range_x, range_y=range_y)

    def downward(self) -> Frame:
        """Return the case's frame the other way."""
        return evolve(self.frame, upward=not self.frame.upward)


def draw_case(seed: int) -> Case:
    """Draw a case; families of hysteresis and kinds of gratings take turns.

    Every fourth image has 512 lines and pixels, and every 25th grating is turned by 45 degrees.
    """
    rng = np.random.default_rng(seed)
    scanner = draw_tube(rng, FAMILIES[seed % len(FAMILIES)])
    overscan = float(rng.uniform(0.0, 0.1)) * float(rng.random() < 0.7)  # noqa: PLR2004 - share
    frame = _frame(rng, scanner, 512 if seed % 4 == 3 else 256, overscan)  # noqa: PLR2004
    pitch = _pitch(rng, frame.range_x)
    reach = 0.75 * max(frame.range_x, frame.range_y)
    kind, angle = list(KINDS)[seed % len(KINDS)], 0.25 * np.pi if seed % 25 == 24 else None  # noqa: PLR2004
    grating = drawn_grating(rng, kind, pitch, reach, angle)
    detection = drawn_detection(rng, grating.depth, reach)
    wait, earlier = float(0.1 * 300.0 ** rng.random()), EARLIER * int(rng.integers(0, 2))
    return Case(scanner, grating, detection, frame, wait, earlier, seed)


def _frame(rng: np.random.Generator, scanner: TubeScanner, pixels: int, overscan: float) -> Frame:
    """Draw a square that takes 30 to 95 % of the drive of the axis with less."""
    most = 2.0 * scanner.upper * min(scanner.nominal) / (1.0 + 2.0 * overscan)
    side = most * float(rng.uniform(0.3, 0.95))
    return Frame(side, side, pixels, pixels, overscan=overscan)


def _pitch(rng: np.random.Generator, side: float) -> float:
    fewest, most = PERIODS
    return float(rng.choice([p for p in PITCHES if fewest <= side / p <= most]))
