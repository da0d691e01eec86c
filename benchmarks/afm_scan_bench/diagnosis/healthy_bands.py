"""What healthy scanners of five hysteresis families leave in each band, over the detection limit.

The diagnosis takes its three constants from this: independent amplitudes of the discrepancy in a
band, those from which its size is known, and its mean square over the squared limit.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from attrs import evolve
from scipy.optimize import minimize
from scipy.stats import f as f_distribution

from afm_scan_bench.families.scanners import FAMILIES, FamilyScanner
from afm_scan_bench.scans import spec_at
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

SEED, SCANS, RESAMPLED = 3, 6, 200
RATES, LINES, SHARES = (5.0, 30.0, 100.0), (6, 16, 40), (0.15, 0.8)
OF_DISCREPANCY = 0.7
"""Share of the limit that noise is in a band, up to which the band shows the discrepancy."""
STARTS = ((1.0, 3.0, 0.3), (3.0, 20.0, 0.3))
BOUNDS = ((-1.0, 4.0), (0.0, 6.0), (-5.0, 2.0))
"""Of the logarithms of both degrees of freedom and of the factor."""

COLUMNS = {
    "family": ("family", ""),
    "bands": ("bands", "d"),
    "freedom": ("amplitudes in a band", ".1f"),
    "known": ("known as from", ".1f"),
    "share": ("mean square / limit squared", ".2f"),
    "largest": ("largest ratio", ".2f"),
}


def measure() -> Table:
    """Fit the F distribution to the bands of each family, and to all with their errors."""
    by_family = {family: list(ratios(family)) for family in FAMILIES}
    rows = [_row(family, found) for family, found in by_family.items()]
    every = [ratio for found in by_family.values() for ratio in found]
    return Table("healthy_bands", _title(every), COLUMNS, [*rows, _row("all", every)])


def ratios(family: str) -> Iterator[Array]:
    """Rms residual over the limit in the bands of each healthy scan of a family."""
    scanner = FamilyScanner.of(family, "none" if family in ("play", "duhem") else "cube behind")
    model = identify_axis(list(scanner.records(SEED).values()), "x").model
    rng = np.random.default_rng(sum(map(ord, family)))
    for _ in range(SCANS):
        rate, lines = float(rng.choice(RATES)), int(rng.choice(LINES))
        size = scanner.reach() * float(rng.uniform(*SHARES))
        spec = evolve(spec_at(rate), lines=lines, range_x=size, range_y=size)
        done = scanner.scan(spec, model)
        yield _ratio(Record.of_traces("scan", done.drive, done.measured, spec), model)


def _ratio(observed: Record, model: AxisModel) -> Array:
    evidence = evidence_of("x", ScannerModel(model, model), observed)
    noisy = evidence.limit.noise / evidence.limit.rms
    return evidence.ratio(chain_of(model))[noisy < OF_DISCREPANCY]


def fitted(found: Sequence[Array]) -> Array:
    """Both degrees of freedom and the factor of the squared ratios, by maximum likelihood."""
    squares = np.concatenate(found) ** 2

    def cost(logs: Array) -> float:
        one, other, factor = np.exp(logs)
        density = f_distribution.logpdf(squares / factor, one, other)
        return -float(np.sum(density - np.log(factor)))

    tried = (minimize(cost, np.log(start), bounds=BOUNDS) for start in STARTS)
    return np.asarray(np.exp(min(tried, key=lambda each: float(each.fun)).x))


def _row(family: str, found: Sequence[Array]) -> Row:
    freedom, known, share = fitted(found)
    squares = np.concatenate(found)
    return {
        "family": family,
        "bands": len(squares),
        "freedom": freedom,
        "known": known,
        "share": share,
        "largest": float(squares.max()),
    }


def _title(every: Sequence[Array]) -> str:
    """Standard errors by drawing scans afresh, since the bands of one scan go together."""
    rng = np.random.default_rng(SEED)
    drawn = [
        fitted([every[i] for i in rng.integers(len(every), size=len(every))])
        for _ in range(RESAMPLED)
    ]
    low, high = np.percentile(drawn, (2.5, 97.5), axis=0)
    limits = ", ".join(f"{a:.2g} to {b:.2g}" for a, b in zip(low, high, strict=True))
    return (
        f"Healthy scans of five families, {SCANS} each: residual over the detection limit by band\n"
        f"95 % intervals of the last row's figures, by bootstrap over scans: {limits}"
    )
