"""Learning with a noisier sensor: no worse than feedforward, and how near to a floor.

The floor adds two errors in quadrature. One is what the same learning leaves with a sensor that
has no noise: what the law, the limits and the number of scans cost. The other is the noise that the
mean of all scans but the last would leave, at the frequencies that were learned: after n scans
nobody knows a repeating error better, and noise at other frequencies does not reach the drive.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve

from afm_scan_bench.learning.learning import error_percent
from afm_scan_bench.learning.repeated import SCANS, repeated
from afm_scan_bench.scans import default_plant, spec_at
from afm_scan_ros.core.comparison import RELEVANT_CHANGE
from afm_scan_ros.features.learning.loop import LearningScan
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.scanner import PlantSpec

RATES = (5.0, 30.0, 100.0, 250.0)
SEEDS = (1, 11, 21)
FACTOR = 5.0
"""Noise over the default sensor's."""
CYCLES = 5

COLUMNS = {
    "line_rate_hz": ("line rate, Hz", ".0f"),
    "seed": ("seed", ".0f"),
    "first_percent": ("feedforward, % rms", ".4f"),
    "learned_percent": (f"{SCANS} scans", ".4f"),
    "quiet_percent": ("no noise", ".4f"),
    "noise_percent": ("noise of the mean", ".4f"),
    "over_floor": ("over the floor", ".2f"),
    "worse": ("ever worse than feedforward", ""),
}


def measure(rates: Sequence[float] = RATES, seeds: Sequence[int] = SEEDS) -> Table:
    """Learn at each rate with each noise."""
    rows = [row for rate in rates for row in _rows(rate, seeds)]
    title = f"True error of x at constant speed with {FACTOR:g} times the sensor's noise"
    return Table("learning_noise", title, COLUMNS, rows)


def noisy(factor: float) -> PlantSpec:
    """Return the default plant with its sensor's noise times a factor."""
    plant = default_plant()
    return evolve(plant, sensor=evolve(plant.sensor, noise_rms=factor * plant.sensor.noise_rms))


def _rows(rate: float, seeds: Sequence[int]) -> Iterator[Row]:
    spec = evolve(spec_at(rate), preparation_cycles=CYCLES)
    quiet = error_percent(repeated(spec, noisy(0.0), seed=seeds[0])[-1])
    for seed in seeds:
        scans = repeated(spec, noisy(FACTOR), seed=seed)
        errors = [error_percent(done) for done in scans]
        noise = 100.0 * mean_noise(scans) / spec.range_x
        yield {
            "line_rate_hz": rate,
            "seed": seed,
            "first_percent": errors[0],
            "learned_percent": errors[-1],
            "quiet_percent": quiet,
            "noise_percent": noise,
            "over_floor": errors[-1] / float(np.hypot(quiet, noise)),
            "worse": "yes" if max(errors) > (1.0 + RELEVANT_CHANGE) * errors[0] else "no",
        }


def mean_noise(scans: Sequence[LearningScan]) -> float:
    """Rms (m) of the noise that the mean of all scans but the last has where x was learned."""
    step = scans[-1].steps["x"]
    learned = np.abs(step.correction) > 0.0
    share = float(learned.sum()) / (step.length / 2.0)
    return step.convergence.noise * float(np.sqrt(share / (len(scans) - 1)))
