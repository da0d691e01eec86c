"""How often the true gains and time constants of creep lie within their 95 % intervals.

The paper's creep (Eqs. 6 and 9), integrated by scipy, is stepped twice; only the noise differs
from seed to seed. The order is chosen anew each time: where it is not three, nothing is inside.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.signal import cont2discrete, lfilter

from afm_scan_bench.paper.creep import CREEP_X, CREEP_Y
from afm_scan_ros.core.identification.creep.fit import CreepFit, fit_creep
from afm_scan_ros.core.model import CreepModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row

SAMPLE_PERIOD = 0.1  # s
HOLDS = (10.0, 1800.0, 300.0)  # s at 0, 0.5 and 1 V
SLOPE = 5e-6  # m/V
NOISE = 2e-9  # m
HIGHEST = 4


def coverage(seeds: Iterable[int]) -> list[Row]:
    """Share of seeds whose 95 % interval holds the truth, a row for each parameter."""
    seeds = list(seeds)
    return [
        row
        for axis, model in {"x": CREEP_X, "y": CREEP_Y}.items()
        for row in _rows(axis, model, list(fits(model, seeds)))
    ]


def fits(model: CreepModel, seeds: Iterable[int]) -> Iterator[CreepFit]:
    """Fit a record of the creep for each seed of its noise."""
    lengths = np.rint(np.array(HOLDS) / SAMPLE_PERIOD).astype(int)
    drive = np.repeat(0.5 * np.arange(len(lengths)), lengths)
    clean = SLOPE * creeping(model, drive)
    for seed in seeds:
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(clean))
        yield fit_creep(drive, clean + noise, SAMPLE_PERIOD, HIGHEST)


def creeping(model: CreepModel, drive: Array) -> Array:
    """Return a held drive with what creep adds to it, both (n,), each element by scipy."""
    response = drive.copy()
    for gain, tau in zip(model.gains, model.time_constants, strict=True):
        numerator, denominator, _ = cont2discrete(([gain], [tau, 1.0]), SAMPLE_PERIOD)
        response += lfilter(numerator[0], denominator, drive)
    return response


def _rows(axis: str, model: CreepModel, found: list[CreepFit]) -> Iterator[Row]:
    truth = {f"gain_{i}": gain for i, gain in enumerate(model.gains, 1)}
    truth |= {f"time_constant_{i}": tau for i, tau in enumerate(model.time_constants, 1)}
    right = [fit.intervals for fit in found if fit.order == len(model.gains)]
    for name, true in truth.items():
        low, high = np.array([intervals[name] for intervals in right]).T
        inside = int(np.sum((low <= true) & (true <= high)))
        yield {
            "effect": "creep",
            "parameter": f"{axis} {name}".replace("_", " "),
            "unit": "s" if name.startswith("time") else "",
            "true": true,
            "seeds": len(found),
            "half_width": float(np.mean(high - low)) / 2.0,
            "inside_percent": 100.0 * inside / len(found),
        }
