"""``afm-scan adapt``: what changed in a recorded scan enters the model, and nothing else does."""

from pathlib import Path

import pytest
from attrs import evolve
from click.testing import CliRunner, Result

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.features.online.adapt_command import adapt
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.simulation.axis import detuned_axis
from helpers.in_process import ALL, FAST_SPEC, default_plant, scan

CONFIG = share_directory() / "config"
SPEC = evolve(FAST_SPEC, lines=30)


def recorded(done: Scan, bag: Path) -> Path:
    with ScanWriter(bag, info_of_scan(done.spec, "scan-1", 0)) as writer:
        writer.add("drive_voltage", done.drive)
        writer.add("achieved_displacement", done.measured)
    return bag


def ran(bag: Path, out: Path) -> Result:
    given = [str(bag), "--model", str(CONFIG / "model.yaml"), "--out", str(out)]
    return CliRunner().invoke(adapt, [*given, "--time-constant", "0.1s"])


def test_a_shifted_resonance_enters_the_model(tmp_path: Path) -> None:
    plant = evolve(default_plant(), x=detuned_axis(default_plant().x, 1.03, 1.0))
    bag = recorded(scan(SPEC, ALL, plant=plant), tmp_path / "bag")
    result = ran(bag, tmp_path / "new.yaml")
    assert result.exception is None, result.output
    found = load_model(tmp_path / "new.yaml")
    (added,) = found.axis("x").added
    assert (added.name, added.kind) == ("parameter_shift", "resonance")
    assert added.values[0] == pytest.approx(1.03, abs=1e-3)
    assert not found.axis("y").added
    assert isinstance(ran(bag, tmp_path / "new.yaml").exception, InputError)  # it is there already


def test_of_an_unchanged_scanner_no_model_is_written(tmp_path: Path) -> None:
    bag = recorded(scan(SPEC, ALL), tmp_path / "bag")
    result = ran(bag, tmp_path / "new.yaml")
    assert isinstance(result.exception, ScanError)
    assert "nothing has changed" in str(result.exception)
    assert not (tmp_path / "new.yaml").exists()


def test_a_record_without_lines_is_refused(tmp_path: Path) -> None:
    done = scan(SPEC, ALL)
    info = ScanInfo("scan-1", 0, "creep", SPEC.sample_period, len(done.drive.x))
    with ScanWriter(tmp_path / "bag", info) as writer:
        writer.add("drive_voltage", done.drive)
        writer.add("achieved_displacement", done.measured)
    result = ran(tmp_path / "bag", tmp_path / "new.yaml")
    assert isinstance(result.exception, InputError)
    assert "scan_info states none" in str(result.exception)


@pytest.mark.parametrize(
    ("change", "said"),
    [({"pattern": "spiral"}, "raster and sinusoidal"), ({"turnaround": 0.0}, "turnaround = 0")],
)
def test_a_scan_that_cannot_be_adapted_is_refused(
    tmp_path: Path, change: dict[str, object], said: str
) -> None:
    _ = ScanSpec(**change)  # type: ignore[arg-type]
    lines = "".join(f"    {name}: {value}\n" for name, value in change.items())
    file = tmp_path / "scan.yaml"
    file.write_text(f"/**/trajectory_generator:\n  ros__parameters:\n{lines}", "utf-8")
    files = ScanFiles(file, CONFIG / "model.yaml", CONFIG / "plant.yaml", tmp_path / "bag")
    with pytest.raises(InputError, match=said):
        run_scan(files, ALL, adapt=True)
