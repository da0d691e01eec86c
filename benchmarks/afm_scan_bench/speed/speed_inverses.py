"""What the inverse of the default model costs a core with each effect of the catalogue added."""

from collections.abc import Iterator
from time import process_time

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.scans import ALL, BENCH_SPEC, default_model
from afm_scan_bench.speed.timing.chain import BLOCK, stream
from afm_scan_bench.speed.timing.ratios import by_turns
from afm_scan_ros.core.compensation import Compensation, Progress
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import Added, InverseSettings, ScannerModel
from afm_scan_ros.core.trajectory import desired
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.report.table import Row, Table

SPEC = evolve(
    BENCH_SPEC,
    line_rate=50.0,
    samples_per_line=2000,
    turnaround=0.3,
    preparation="none",
    approach=0.02,
)
"""Lines at 100 kHz, as fast as every example's inverse can follow."""
SETTINGS = InverseSettings(preview=0.04)
"""As long as the slowest resonance of any example needs."""
FREE = DriveLimits(voltage=1e3, slew=1e9)
FIRST = 4000
"""Sample within the lines, from which on a whole one is timed."""
TARGET = 2.0  # µs a sample and axis
HEAT = "rate_dependent_hysteresis", "activated"
BESIDE_HEAT = ("delay", "extra_resonance", "hysteretic_stiffness", "static_nonlinearity")

COLUMNS = {
    "effect": ("effect", ""),
    "us": ("µs of a core a sample and axis", ".3f"),
    "ratio": ("over the base model's", ".2f"),
    "met": (f"≤ {TARGET:g} µs", ""),
}


def measure(samples: int = SPEC.samples_per_line, turns: int = 60) -> Table:
    """Time the inverses of all forms of all effects, and of pairs with heat."""
    title = f"Inverses in blocks of {BLOCK} samples at 100 kHz, both axes at 50 lines a second"
    return Table("speed_inverses", title, COLUMNS, list(rows(samples, turns)))


def rows(samples: int, turns: int) -> Iterator[Row]:
    """Yield a row for each extension: the least time of all turns, the median of their ratios."""
    added: dict[str, tuple[Added, ...]] = {"none, the base model": (), **extensions()}
    timed = [Timed.of(each, samples) for each in added.values()]
    base, *others = by_turns(turns, *(each.microseconds for each in timed))
    for name, times in zip(added, (base, *others), strict=True):
        yield {
            "effect": name,
            "us": min(times),
            "ratio": float(np.median(np.divide(times, base))),
            "met": "yes" if min(times) <= TARGET else "no",
        }


def extensions() -> dict[str, tuple[Added, ...]]:
    """What is added to both axes of the model, by its name."""
    singles = {
        f"{each.name} {form.kind}".strip(): (_example(each.name, form.kind),)
        for each in CATALOGUE
        for form in each.forms
    }
    heat = _example(*HEAT)
    mains = {name: effect_type(name).forms[0].kind for name in BESIDE_HEAT}
    pairs = {
        f"{' '.join(HEAT)} + {name}": (heat, _example(name, kind)) for name, kind in mains.items()
    }
    return {**singles, **pairs}


def _example(name: str, kind: str) -> Added:
    return Added(name, kind, effect_type(name).form(kind).example)


@frozen(eq=False)
class Timed:
    """An inverse that has come to the first line, and the lines it is to invert."""

    chain: Compensation
    progress: Progress
    lines: Trace

    @classmethod
    def of(cls, added: tuple[Added, ...], samples: int) -> "Timed":
        """Inverse of the default model with effects added to both axes."""
        chain = Compensation(extended(added), SPEC.sample_period, ALL, SETTINGS, FREE)
        progress = stream(chain, chain.at_rest(), _both(0, FIRST), BLOCK)
        return cls(chain, progress, _both(FIRST, samples))

    def microseconds(self) -> float:
        """Time of a core that a sample of an axis takes, after one turn that fills the cache."""
        for _ in range(2):
            start = process_time()
            stream(self.chain, self.progress, self.lines, BLOCK)
        return 1e6 * (process_time() - start) / (len(AXES) * len(self.lines.x))


def extended(added: tuple[Added, ...]) -> ScannerModel:
    """Return the default model with effects added to both axes."""
    model = default_model()
    return ScannerModel(*(evolve(model.axis(name), added=added) for name in AXES))


def _both(first: int, samples: int) -> Trace:
    """Displacement (m) of both axes, which do what x does: the slow axis would cost less."""
    fast = desired(SPEC, first, samples).x
    return Trace(first, SPEC.sample_period, fast, fast)
