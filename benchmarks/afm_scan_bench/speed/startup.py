"""How long it takes until the command, or the core, is there."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from afm_scan_bench.speed.timing.ratios import COLUMNS, by_turns, row, seconds
from afm_scan_ros import core
from afm_scan_ros.report.table import Table

TURNS = 15

HELP = ("-c", "from afm_scan_ros.cli.main import main; main()", "--help")
NUMERICS = ("-c", "import numpy, scipy.signal")
INVERSE = ("-c", "import afm_scan_ros.core.compensation, afm_scan_ros.core.trajectory")


def measure() -> Table:
    """Start each as a process of its own, by turns."""
    return table(TURNS)


def table(turns: int) -> Table:
    """Return the table of so many turns."""
    starts = [
        _start(*arguments)
        for arguments in (HELP, ("-c", "pass"), NUMERICS, INVERSE, _all_of_core())
    ]
    help_time, nothing, numerics, inverse, core = by_turns(turns, *starts)
    against = "import numpy, scipy.signal"
    rows = [
        row("afm-scan --help", "python -c pass", "s", "≤ 5", help_time, nothing),
        row("import of what inverts a scan", against, "s", "≤ 1.3", inverse, numerics),
        row("import of every module of core", against, "s", "≤ 1.3", core, numerics),
    ]
    return Table("startup", "Start-up, each as a process of its own", COLUMNS, rows)


def _start(*arguments: str) -> Callable[[], float]:
    """Return the measure of a start that finds bytecode, as every start but the first does."""
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}

    def start() -> None:
        command = [sys.executable, *arguments]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)  # noqa: S603 - our own interpreter

    return seconds(start)


def _all_of_core() -> tuple[str, str]:
    root = Path(core.__file__).parents[2]
    paths = sorted(Path(core.__file__).parent.rglob("*.py"))
    names = [".".join(path.relative_to(root).with_suffix("").parts) for path in paths]
    return "-c", "import " + ", ".join(name.removesuffix(".__init__") for name in names)
