"""Whether learning ever makes a scan worse: scanners drawn around the model, up to 10 % from it."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.learning.repeated import SCANS, repeated
from afm_scan_bench.scans import default_plant, spec_at, tracking
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.comparison import RELEVANT_CHANGE, rms_of
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.features.learning.loop import LearningScan, best_of
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.axis import (
    AxisSpec,
    HysteresisSpec,
    RationalSpec,
    detuned_axis,
    series,
    with_series,
)
from afm_scan_ros.simulation.scanner import PlantSpec

COUNT = 500
LARGEST = 0.1
"""Largest relative difference of each parameter from the plant's that the model was made of."""
RATES = (5.0, 30.0, 100.0, 250.0)
CYCLES = 5
"""Oscillations of the preparation."""

COLUMNS = {
    "line_rate": ("line rate, Hz", ""),
    "count": ("scanners", ".0f"),
    "refused": ("refused", ".0f"),
    "diverged": ("kept scan worse", ".0f"),
    "diverged_last": ("last scan worse", ".0f"),
    "largest": ("largest error over the first", ".3f"),
    "growth_nm": ("largest growth, nm", ".1f"),
    "first_nm": ("first, median nm", ".0f"),
    "median": ("kept over first, median", ".4f"),
    "most": ("95 %", ".4f"),
    "worst": ("worst", ".4f"),
}


@frozen
class LearningCourse:
    """True errors (m) of one scanner's scans, of each axis, and which scan was kept.

    There are none where the first scan was refused.
    """

    line_rate: float
    errors: tuple[tuple[float, ...], ...] = ()
    kept: int = 0

    def over_first(self, number: int) -> float:
        """Largest error of an axis in a scan over that in the first one."""
        return max(each[number] / each[0] for each in self.errors)

    @property
    def growth(self) -> float:
        """Largest growth of an axis' error from one scan to the next, m."""
        return max(float(np.diff(each).max()) for each in self.errors)


def measure(count: int = COUNT, seed: int = 1) -> Table:
    """Learn the scans of so many scanners with the default model."""
    with working("drawn scanners") as announce:
        courses = list(drawn_courses(count, seed, announce))
    rows = [_row(f"{rate:g}", [c for c in courses if c.line_rate == rate]) for rate in RATES]
    title = (
        f"True error of the worse axis after {SCANS} scans of scanners up to"
        f" {100 * LARGEST:.0f} % from the model; worse is by {100 * RELEVANT_CHANGE:.0f} %"
    )
    return Table("learning_drawn", title, COLUMNS, [*rows, _row("all", courses)])


def drawn_courses(
    count: int, seed: int, announce: Callable[[str], None]
) -> Iterator[LearningCourse]:
    """Draw scanners by their number, and learn a scan of each."""
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        rate = float(rng.choice(RATES))
        announce(f"{number} of {count}")
        spec = evolve(spec_at(rate), preparation_cycles=CYCLES)
        yield course(spec, near(default_plant(), rng), int(rng.integers(2**31)))


def course(spec: ScanSpec, plant: PlantSpec, seed: int) -> LearningCourse:
    """Learn a scan of a scanner."""
    try:
        scans = repeated(spec, plant, seed=seed)
    except ScanError:
        return LearningCourse(spec.line_rate)
    return LearningCourse(spec.line_rate, _errors(scans), scans.index(best_of(scans)))


def near(plant: PlantSpec, rng: np.random.Generator) -> PlantSpec:
    """Draw a scanner whose parameters are within ``LARGEST`` of the plant's, axis by axis."""
    x, y = (_axis(axis, rng) for axis in (plant.x, plant.y))
    return evolve(plant, x=x, y=y)


def _axis(axis: AxisSpec, rng: np.random.Generator) -> AxisSpec:
    moved = detuned_axis(axis, _factor(rng), _factor(rng))
    gain = _factor(rng)
    numerator = tuple(gain * each for each in moved.vibration.numerator)
    return evolve(
        moved,
        hysteresis=_hysteresis(axis.hysteresis, rng),
        vibration=RationalSpec(numerator, moved.vibration.denominator),
        creep=_creep(axis.creep, rng),
    )


def _hysteresis(old: HysteresisSpec, rng: np.random.Generator) -> HysteresisSpec:
    return evolve(
        old,
        gain=old.gain * _factor(rng),
        density=old.density * _factor(rng),
        threshold_max=old.threshold_max * _factor(rng),
        decay=old.decay * _factor(rng),
    )


def _creep(old: RationalSpec, rng: np.random.Generator) -> RationalSpec:
    gains, taus = (
        each * rng.uniform(1.0 - LARGEST, 1.0 + LARGEST, each.size) for each in series(old)
    )
    return with_series(old, gains, taus)


def _factor(rng: np.random.Generator) -> float:
    return float(rng.uniform(1.0 - LARGEST, 1.0 + LARGEST))


def _errors(scans: Sequence[LearningScan]) -> tuple[tuple[float, ...], ...]:
    found = [tracking(done.scan) for done in scans]
    return tuple(tuple(rms_of(each, axis) for each in found) for axis in AXES)


def _row(line_rate: str, courses: Sequence[LearningCourse]) -> Row:
    done = [each for each in courses if each.errors]
    kept = np.array([each.over_first(each.kept) for each in done])
    last = np.array([each.over_first(-1) for each in done])
    every = [each.over_first(k) for each in done for k in range(len(each.errors[0]))]
    return {
        "line_rate": line_rate,
        "count": len(courses),
        "refused": len(courses) - len(done),
        "diverged": int((kept > 1.0 + RELEVANT_CHANGE).sum()),
        "diverged_last": int((last > 1.0 + RELEVANT_CHANGE).sum()),
        "largest": max(every, default=np.nan),
        "growth_nm": 1e9 * max((each.growth for each in done), default=np.nan),
        "first_nm": 1e9 * float(np.median([max(e[0] for e in each.errors) for each in done])),
        "median": float(np.median(kept)),
        "most": float(np.quantile(kept, 0.95)),
        "worst": float(kept.max()),
    }
