"""Faults injected into a scan, how often, and how often something promised was lost by it."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module

from afm_scan_ros.cli.progress import working
from afm_scan_ros.report.table import Row, Table

FAULTS = (
    "kill",
    "signal",
    "disk",
    "order",
    "link",
    "damaged_bags",
    "mutated_files",
    "stated_sizes",
    "fuzzed_readers",
    "foreign_nodes",
)
"""Modules of ``injection``, whose ``inject(announce)`` yields a row for each of its faults."""

COLUMNS: Mapping[str, tuple[str, str]] = {
    "fault": ("fault", ""),
    "trials": ("trials", "d"),
    "losses": ("losses", "d"),
    "figures": ("figures", ""),
}

Announce = Callable[[str], None]


def row(fault: str, trials: int, broken: Sequence[str], figures: str) -> Row:
    """Describe what became of a fault; ``broken`` states the loss of each trial with one."""
    text = "; ".join([figures, *broken])
    return {"fault": fault, "trials": trials, "losses": len(broken), "figures": text}


def measure(names: Sequence[str] = FAULTS) -> Table:
    """Inject every fault, or those of some modules."""
    with working("faults") as announce:
        modules = [import_module(f"afm_scan_bench.faults.injection.{name}") for name in names]
        rows = [row for module in modules for row in module.inject(announce)]
    return Table("faults", "Faults, and what was lost by them", COLUMNS, rows)
