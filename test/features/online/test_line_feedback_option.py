"""``afm-scan scan --line-feedback``: what it refuses, and what it does not wait for in vain."""

from pathlib import Path

import pytest
from attrs import evolve

from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.errors import InputError, ScanError

SPEC = """\
/**/trajectory_generator:
  ros__parameters: {pattern: PATTERN, line_rate_hz: 20.0, lines: 8, samples_per_line: 1000}
"""
IMPATIENT = {"inversion_compensator": {"liveness_timeout_s": 0.5}}
ALL = ("creep", "hysteresis", "vibration")


@pytest.fixture
def files(tmp_path: Path) -> ScanFiles:
    """Return the files of a raster scan."""
    (tmp_path / "scan.yaml").write_text(SPEC.replace("PATTERN", "raster"), "utf-8")
    plant = CONFIG / "plant.yaml"
    return ScanFiles(tmp_path / "scan.yaml", CONFIG / "model.yaml", plant, tmp_path / "bag")


def test_a_pattern_without_lines_is_refused_before_anything_starts(files: ScanFiles) -> None:
    files.spec.write_text(SPEC.replace("PATTERN", "spiral"), "utf-8")
    with pytest.raises(InputError, match="line feedback corrects raster and sinusoidal scans"):
        run_scan(files, ALL, line_feedback=True)


def test_an_exchange_of_files_is_refused(files: ScanFiles) -> None:
    given = evolve(files, scanner="files:settings.yaml")
    with pytest.raises(InputError, match="files are exchanged once a scan"):
        run_scan(given, ALL, line_feedback=True)


@pytest.mark.evidence
def test_a_scanner_that_reads_too_late_fails_the_scan_by_name(
    files: ScanFiles, tmp_path: Path
) -> None:
    text = (CONFIG / "simulated_scanner.yaml").read_text("utf-8")
    late = tmp_path / "late.yaml"
    late.write_text(text.replace("latency_samples: 0", "latency_samples: 3000"), "utf-8")
    given = evolve(files, scanner=f"simulated:{late}")
    with pytest.raises(ScanError, match=r"line 0, which scanner_driver has not read: feedback_lat"):
        run_scan(given, ALL, 0.0, IMPATIENT, line_feedback=True)
