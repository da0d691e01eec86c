"""How often the truth lies within its 95 % interval when the whole chain is identified.

Scanners drawn afresh, all effects at work, are calibrated and identified as the commands do it.
Creep is compared by the sum of its gains. Gain and hysteresis are not: only the product of F and
G(0) is seen.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from afm_scan_bench.accuracy.coverage import StatedInterval, with_bounds
from afm_scan_bench.draw import drawn
from afm_scan_bench.in_process import calibrate_in_process
from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.identification.identify import identify_records
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.axis import AxisSpec, series

PLANTS = 20

COLUMNS = {
    "parameter": ("parameter", ""),
    "seeds": ("axes", "d"),
    "error_percent": ("error rms, %", ".4f"),
    "half_percent": ("± 95 %, %", ".4f"),
    "inside_percent": ("inside, %", ".1f"),
    "lowest_percent": ("at least, %", ".1f"),
    "highest_percent": ("at most, %", ".1f"),
}


def measure() -> Table:
    """Identify both axes of 20 scanners."""
    title = "Whole chain, scanners drawn afresh: 95 % intervals that hold the truth"
    rows = [with_bounds(row) for row in coverage(range(PLANTS))]
    return Table("chain_coverage", title, COLUMNS, rows)


def coverage(seeds: Iterable[int]) -> list[Row]:
    """Share of axes whose 95 % interval holds the truth, a row for each parameter."""
    found: dict[str, list[StatedInterval | None]] = {}
    for name, interval in (each for seed in seeds for each in _scanner(seed)):
        found.setdefault(name, []).append(interval)
    return [_row(name, intervals) for name, intervals in found.items()]


def _scanner(seed: int) -> Iterator[tuple[str, StatedInterval | None]]:
    """Parameters of both axes of a scanner that a seed draws."""
    plant = drawn(default_plant(), np.random.default_rng(seed))
    records = calibrate_in_process(plant, seed)
    for axis, found in identify_records(list(records.values())).axes.items():
        effects, true = found.model.effects, true_figures(plant.axes()[axis])
        for name in ("resonance", "damping"):
            yield name, StatedInterval.of(effects.vibration, name, true[name])
        yield "creep", StatedInterval.of(effects.creep, "gain", true["creep"])


def true_figures(axis: AxisSpec) -> Mapping[str, float]:
    """Resonance (Hz), its damping ratio and the sum of the gains of creep of a simulated axis."""
    poles = np.roots(axis.vibration.denominator)
    pole = poles[np.argmin(-poles.real / np.abs(poles))]
    return {
        "resonance": float(np.abs(pole) / (2.0 * np.pi)),
        "damping": float(-pole.real / np.abs(pole)),
        "creep": float(np.sum(series(axis.creep)[0])),
    }


def _row(name: str, intervals: Sequence[StatedInterval | None]) -> Row:
    """Figures of a parameter; an interval that is not stated holds nothing."""
    stated = [each for each in intervals if each]
    return {
        "parameter": name,
        "seeds": len(intervals),
        "error_percent": 100.0 * float(np.sqrt(np.mean([each.error**2 for each in stated]))),
        "half_percent": 100.0 * float(np.median([each.half_width for each in stated])),
        "inside_percent": 100.0 * sum(each.inside for each in stated) / len(intervals),
    }
