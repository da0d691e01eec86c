"""Faults injected into a scan, how often, and how often something promised was lost by it."""

from collections.abc import Callable, Mapping
from importlib import import_module

from afm_scan_ros.bench.table import Row, Table
from afm_scan_ros.cli.working import working

FAULTS = (
    "kill",
    "signal",
    "disk",
    "order",
    "viewer",
    "link",
    "damaged_bags",
    "mutated_files",
    "stated_sizes",
    "strangers",
)
"""Modules ``faults_NAME``; the ``inject(say)`` of each yields a row for each of its faults."""

COLUMNS: Mapping[str, tuple[str, str]] = {
    "fault": ("fault", ""),
    "trials": ("trials", "d"),
    "losses": ("losses", "d"),
    "figures": ("figures", ""),
}

Say = Callable[[str], None]


def row(fault: str, trials: int, losses: int, figures: str) -> Row:
    """Describe what became of a fault; ``losses`` are the trials that broke a promise."""
    return {"fault": fault, "trials": trials, "losses": losses, "figures": figures}


def measure() -> Table:
    """Inject every fault."""
    with working("faults") as say:
        modules = [import_module(f"afm_scan_ros.bench.faults_{name}") for name in FAULTS]
        rows = [row for module in modules for row in module.inject(say)]
    return Table("faults", "Faults, and what was lost by them", COLUMNS, rows)
