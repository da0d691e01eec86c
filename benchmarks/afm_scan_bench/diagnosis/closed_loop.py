"""What closing the loop brings with large effects of ``config/plants``, scanned by the nodes."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from afm_scan_bench.scans import SEED, default_model
from afm_scan_ros.cli.driving import DrivenScanner, RecordedSession
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.closed_loop import Round, close_loop, validation_specs
from afm_scan_ros.core.comparison import rms_of
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import share_directory
from afm_scan_ros.report.diagnosis_text import effects
from afm_scan_ros.report.table import Row, Table

PLANTS = (
    "plants/delay_large",
    "plants/parameter_shift_gain_large",
    "plants/cross_coupling_mode_large",
    "plants/backlash_large",
    "plants/hysteretic_stiffness_large",
    "plants/slow_creep_single_large",
    "plants/drift_large",
    "plants/delay_and_drift_large",
    "plants/periodic_disturbance_mains_large",
    "plants/bow_large",
    "plant",
)
"""Files of ``config/``; what is missing in the model acts in x."""
AXIS = "x"
ROUNDS = 3
SPEC = ScanSpec(
    range_x=20e-6,
    range_y=20e-6,
    line_rate=20.0,
    lines=16,
    samples_per_line=1000,
    preparation_cycles=5,
)
HEADINGS = {"same": "the scan", "rate": "40 Hz", "amplitude": "10 µm", "pattern": "spiral"}
COLUMNS = {
    "plant": ("plant", ""),
    "found": (f"found in {AXIS}", ""),
    **{
        f"{name}_{moment}_nm": (heading, ".1f")
        for name, title in HEADINGS.items()
        for moment, heading in (("before", title), ("after", "→"))
    },
}


def measure(plants: Sequence[str] = PLANTS) -> Table:
    """Close the loop on each plant, as ``afm-scan close-loop`` does."""
    with working("closed loop") as announce, TemporaryDirectory() as folder:
        rows = [_row(plant, Path(folder) / str(i), announce) for i, plant in enumerate(plants)]
    return Table("closed_loop", f"Measured error of {AXIS}, nm rms", COLUMNS, rows)


def _row(plant: str, folder: Path, announce: Callable[[str], None]) -> Row:
    scanner = DrivenScanner(plant=share_directory() / f"config/{plant}.yaml", seed=SEED)
    session = RecordedSession(scanner, folder)
    trace = partial(diagnose, progress=lambda doing: announce(f"{plant}: {doing}"))
    announce(plant)
    rounds = list(close_loop(session, default_model(), validation_specs(SPEC), ROUNDS, trace))
    return {"plant": plant, **_figures(rounds)}


def _figures(rounds: Sequence[Round]) -> Row:
    """Errors with the given model, and with the last extended model that was kept, if any."""
    before = rounds[0].before
    kept = [done for done in rounds if done.kept]
    after, progress = (kept[-1].after, kept[-1]) if kept else (before, rounds[0])
    figures: dict[str, float | int | str] = {"found": _effects_text(progress.diagnosis)}
    for name in before:
        figures[f"{name}_before_nm"] = _error_nm(before[name])
        figures[f"{name}_after_nm"] = _error_nm(after[name])
    return figures


def _error_nm(done: Scan) -> float:
    return 1e9 * rms_of(done.tracking("measured"), AXIS)


def _effects_text(found: ScannerDiagnosis) -> str:
    every = [row for table in effects(found) for row in table.rows]
    rows = [(name, *value) for name, axis, *value in every if axis == AXIS]
    progress = ", ".join(" ".join(filter(None, row)) for row in rows)
    return progress or found.by_axis[AXIS].verdict.replace("_", " ")
