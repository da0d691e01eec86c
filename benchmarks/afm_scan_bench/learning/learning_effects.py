"""What learning makes of each effect that the model lacks, at the large size.

Beside the error with an effect stands that of the same scanner without it, learned and not.
"""

from collections.abc import Sequence

from attrs import evolve

from afm_scan_bench.learning.learning import error_percent
from afm_scan_bench.learning.repeated import SCANS, repeated
from afm_scan_bench.mechanisms.product_sizes import EFFECTS, sized
from afm_scan_bench.scans import default_plant, spec_at
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.features.learning.loop import LearningScan, best_of
from afm_scan_ros.report.table import Row, Table

AXIS = "x"
LINE_RATE = 5.0
MORE = 10
"""Scans, of which the first ``SCANS`` stand in a column of their own."""
LARGEST = 1.1
"""Largest error over that of feedforward without the effect."""

COLUMNS = {
    "effect": ("effect, large, in x", ""),
    "first_percent": ("feedforward, % rms", ".4f"),
    "six_percent": (f"{SCANS} scans", ".4f"),
    "learned_percent": (f"{MORE} scans", ".4f"),
    "ratio": ("over the healthy one", ".2f"),
    "met": (f"≤ {LARGEST:g}", ""),
    "changing_percent": ("differs from scan to scan, %", ".4f"),
}


def measure(effects: Sequence[str] = tuple(EFFECTS), scans: int = MORE, seed: int = 1) -> Table:
    """Learn the scan of each plant with one effect, and of the plant without any."""
    healthy = _learned("", scans, seed)
    rows = [_row("none", healthy, healthy)]
    with working("effects") as announce:
        for effect in effects:
            announce(effect)
            try:
                rows.append(_row(effect, _learned(effect, scans, seed), healthy))
            except ScanError as error:
                rows.append(_refused(effect, error))
    title = f"True error of x at constant speed, {LINE_RATE:g} Hz, model without the effect"
    return Table("learning_effects", title, COLUMNS, rows)


def _learned(effect: str, scans: int, seed: int) -> list[LearningScan]:
    mechanisms = sized(effect, "large", AXIS) if effect else ()
    plant = evolve(default_plant(), mechanisms=mechanisms)
    return repeated(spec_at(LINE_RATE), plant, scans, seed=seed)


def _row(name: str, scans: list[LearningScan], healthy: Sequence[LearningScan]) -> Row:
    learned = error_percent(best_of(scans))
    ratio = learned / error_percent(healthy[0])
    return {
        "effect": name.replace("_", " "),
        "first_percent": error_percent(scans[0]),
        "six_percent": error_percent(best_of(scans[:SCANS])),
        "learned_percent": learned,
        "ratio": ratio,
        "met": "yes" if ratio <= LARGEST else "no",
        "changing_percent": changing_percent(scans),
    }


def changing_percent(scans: Sequence[LearningScan]) -> float:
    """Rms of what differs between the true displacements of two scans of one drive, %.

    It is that of one scan: their difference over the root of two.
    """
    first, second = (done.scan for done in scans[:2])
    difference = evolve(
        first, true=evolve(first.desired, x=first.desired.x + second.true.x - first.true.x)
    )
    found = error_percent(LearningScan(difference, scans[0].correction, {}))
    return float(found / 2.0**0.5)


def _refused(effect: str, error: ScanError) -> Row:
    figures = dict.fromkeys(COLUMNS, float("nan"))
    return {**figures, "effect": f"{effect.replace('_', ' ')}: {error}", "met": "no"}
