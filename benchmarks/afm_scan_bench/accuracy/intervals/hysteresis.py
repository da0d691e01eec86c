"""How often the true Everett surface lies within its 95 % intervals.

The simulated plays alone, without their quadratics, so that minor loops are congruent and the
surface is known in closed form; only the noise differs from seed to seed.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from attrs import evolve

from afm_scan_bench.scans import default_plant
from afm_scan_ros.core.identification.drives.excitation import hysteresis_plan
from afm_scan_ros.core.identification.hysteresis.everett_equations import EverettGrid
from afm_scan_ros.core.identification.hysteresis.everett_least_squares import (
    FittedSurface,
    fit_surface,
)
from afm_scan_ros.core.identification.hysteresis.reversal_curves import reversal_curves
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row
from afm_scan_ros.simulation.axis import PlayBank

LIMIT = 4.0  # V
LEVELS = 26
NOISE = 0.05  # V
SPACING = 0.01  # V, between samples
NODES = ((25, 0), (25, 12), (18, 6), (12, 0), (12, 10))
"""Levels of alpha and beta at which the surface is looked at: large falls and small."""
TWO_SIDED_95 = 1.96


def coverage(seeds: Iterable[int]) -> list[Row]:
    """Share of seeds whose 95 % interval holds the truth, a row for each value looked at."""
    spec = evolve(default_plant().x.hysteresis, input_quadratic=0.0, output_quadratic=0.0)
    bank = PlayBank.from_spec(spec)
    fits = list(fitted(bank, seeds))
    truth = true_surface(bank, fits[0].grid)
    deviations = np.array([fit.values - truth for fit in fits])
    widths = TWO_SIDED_95 * np.array([fit.standard_errors() for fit in fits])
    inside = np.abs(deviations) <= widths
    levels = fits[0].grid.levels
    return [
        {
            "effect": "hysteresis",
            "parameter": f"E({levels[i]:.3g} V, {levels[j]:.3g} V)",
            "unit": "V",
            "true": float(truth[i, j]),
            "seeds": len(fits),
            "half_width": float(widths[:, i, j].mean()),
            "inside_percent": 100.0 * float(inside[:, i, j].mean()),
        }
        for i, j in NODES
    ]


def fitted(bank: PlayBank, seeds: Iterable[int]) -> Iterator[FittedSurface]:
    """Surfaces of the plays' reversal curves, read with noise, seed by seed."""
    corners = hysteresis_plan(LIMIT, LEVELS).x.levels
    reached = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    samples = np.arange(round(reached[-1] / SPACING) + 1)
    drive = np.interp(samples * SPACING, reached, corners)
    clean, curves = bank.apply(bank.relaxed(), drive)[1], reversal_curves(drive)
    for seed in seeds:
        noise = NOISE * np.random.default_rng(seed).standard_normal(len(drive))
        yield fit_surface(curves.of(drive, clean + noise), EverettGrid(-LIMIT, LIMIT, LEVELS))


def true_surface(bank: PlayBank, grid: EverettGrid) -> Array:
    """Half of what the plays take back of each fall: each all but twice its threshold."""
    fall = np.tril(grid.levels[:, np.newaxis] - grid.levels)
    plays = np.maximum(fall[..., np.newaxis] - 2.0 * bank.thresholds, 0.0) @ bank.weights
    return np.asarray(0.5 * bank.gain * (fall + plays))
