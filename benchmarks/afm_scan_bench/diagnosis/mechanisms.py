"""How far each mechanism moves the simulated scanner, on a scan that does not know of it."""

from collections.abc import Iterator
from functools import cache

import numpy as np
from attrs import evolve

from afm_scan_bench.mechanisms.product_sizes import EFFECTS, SIZES, sized
from afm_scan_bench.mechanisms.sizes import PAIRS
from afm_scan_bench.scans import ALL, SEED, default_plant, lines_of, scan, spec_at
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.report.table import Row, Table
from afm_scan_ros.simulation.mechanisms.base import Mechanism
from afm_scan_ros.simulation.scanner import Piezoscanner

LINE_RATES = (5.0, 30.0, 100.0)
AXIS = "x"
OUTSIDE = "outside the catalogue"

COLUMNS = {
    "effect": ("effect", ""),
    "name": ("explained by", ""),
    "size": ("size", ""),
    **{f"rms_{rate:g}_hz_nm": (f"{rate:g} Hz", ".0f") for rate in LINE_RATES},
}


def measure() -> Table:
    """Scan 40 µm with all inverses, each effect at each size on x."""
    rows = [*_rows_of_effects(), *_rows_of_pairs()]
    title = (
        "What each effect adds to the true displacement of x, its mean removed: rms, nm,\n"
        "over the lines of a raster of 40 µm, the drive being that of the scanner without it"
    )
    return Table("mechanisms", title, COLUMNS, rows)


def added_nm(mechanisms: tuple[Mechanism, ...], line_rate: float) -> float:
    """Rms in nm that mechanisms of x add to a scan at one of the bench's line rates."""
    done = _healthy(line_rate)
    plant = evolve(default_plant(), mechanisms=mechanisms)
    _, true = Piezoscanner(plant, done.spec.sample_period, SEED).advance(done.drive)
    added = lines_of(done.spec, true.axis(AXIS) - done.true.axis(AXIS))
    return 1e9 * float(np.std(added))


@cache
def _healthy(line_rate: float) -> Scan:
    return scan(spec_at(line_rate), ALL)


def _rows_of_effects() -> Iterator[Row]:
    for effect, found in EFFECTS.items():
        for size in SIZES:
            yield _row(effect, found.name or OUTSIDE, size, sized(effect, size, AXIS))


def _rows_of_pairs() -> Iterator[Row]:
    for pair in PAIRS:
        names = " and ".join(EFFECTS[effect].name or OUTSIDE for effect in pair)
        for size in SIZES:
            both = (each for effect in pair for each in sized(effect, size, AXIS))
            yield _row(" and ".join(pair), names, size, tuple(both))


def _row(effect: str, name: str, size: str, mechanisms: tuple[Mechanism, ...]) -> Row:
    rms = {f"rms_{rate:g}_hz_nm": added_nm(mechanisms, rate) for rate in LINE_RATES}
    return {"effect": effect, "name": name, "size": size, **rms}
