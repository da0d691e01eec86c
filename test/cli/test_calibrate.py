"""``afm-scan calibrate --experiment`` records that experiment alone, in a bag of its name."""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import execution
from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS, resized
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from helpers.in_process import default_plant, drive_through

PLANT = share_directory() / "config/plant.yaml"


def test_bag_holds_the_experiment_as_the_process_itself_would_record_it(tmp_path: Path) -> None:
    arguments = ["--experiment", "rest", "--out", str(tmp_path)]
    done = CliRunner().invoke(calibrate, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    command = f"afm-scan diagnose BAG... {tmp_path / 'rest'} --model"
    assert f"together with the bags of the ambiguous diagnosis: {command}" in done.output
    assert f"Recorded the simulated scanner of {PLANT} in {tmp_path}." in done.output
    bag = read_scan(tmp_path / "rest")
    drive, displacement = drive_through(EXPERIMENTS["rest"].plan(), default_plant(), seed=1)
    assert [folder.name for folder in tmp_path.iterdir()] == [bag.info.pattern] == ["rest"]
    np.testing.assert_array_equal(bag.whole("drive_voltage").y, drive.y)
    np.testing.assert_array_equal(bag.whole("achieved_displacement").y, displacement.y)


def test_a_bag_that_exists_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "hold").mkdir()
    arguments = ["--experiment", "hold", "--out", str(tmp_path)]
    with pytest.raises(InputError, match="hold exists already"):
        CliRunner().invoke(calibrate, arguments, catch_exceptions=False)


@pytest.mark.parametrize("model", [[], ["--model", str(share_directory() / "config/model.yaml")]])
def test_amplitude_and_length_are_as_asked(tmp_path: Path, model: list[str]) -> None:
    size = ["--amplitude", "800mV", "--duration", "1.1s"]
    arguments = ["--experiment", "broadband", *size, "--export", str(tmp_path), *model]
    done = CliRunner().invoke(calibrate, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "broadband.npz") as drive:
        assert np.abs(drive["drive_v"]).max() == pytest.approx(0.8)
        assert len(drive["drive_v"]) * drive["sample_period_s"] == pytest.approx(1.1)


def test_a_simulated_scanner_is_driven_as_asked(tmp_path: Path) -> None:
    run_calibration(DrivenScanner(), tmp_path, [resized(EXPERIMENTS["broadband"].plan(), 0.2, 4.0)])
    drive = read_scan(tmp_path / "broadband").whole("drive_voltage")
    assert np.abs(drive.x).max() == pytest.approx(0.2, rel=0.1)
    assert len(drive.x) * drive.sample_period == pytest.approx(4.0)


def test_only_an_experiment_has_a_size(tmp_path: Path) -> None:
    done = CliRunner().invoke(calibrate, ["--amplitude", "1V", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "give it too" in done.output


def test_every_experiment_is_announced() -> None:
    message = CliRunner().invoke(calibrate, ["--help"]).output
    for name in EXPERIMENTS:
        assert f"  {name}: " in message


def test_help_says_which_scanner_is_driven() -> None:
    message = CliRunner().invoke(calibrate, ["--help"]).output
    assert "[default: (config/plant.yaml)]" in " ".join(message.split())


SLOW_BLOCK = """\
import time
from afm_scan_ros.simulation.scanner import Piezoscanner

advance = Piezoscanner.advance


def slowly(self, drive):
    if drive.x.size > 2 and self.next_sample == 0:
        time.sleep(4.0)
    return advance(self, drive)


Piezoscanner.advance = slowly
"""
"""For every process: the scanner's first block takes longer than any node may be silent."""


SLOW_SOURCE = """\
import time
from afm_scan_ros.core.identification.drives import excitation

block = excitation.excitation_block


def slowly(plan, first, count):
    if first:
        time.sleep(2.0)
    return block(plan, first, count)


excitation.excitation_block = slowly
"""
"""For every process: the source takes longer for its blocks than any part may be silent."""


@pytest.fixture
def slow_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _at_start_of_each_process(SLOW_SOURCE, tmp_path, monkeypatch)
    block = execution.excitation_block

    def slowly(plan: Plan, first: int, count: int) -> Trace:
        time.sleep(2.0 if first else 0.0)
        return block(plan, first, count)

    monkeypatch.setattr(execution, "excitation_block", slowly)


@pytest.fixture
def slow_block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _at_start_of_each_process(SLOW_BLOCK, tmp_path, monkeypatch)


def _at_start_of_each_process(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sitecustomize.py").write_text(code, "utf-8")
    path = [str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path))


@pytest.mark.evidence
@pytest.mark.usefixtures("slow_block")
def test_a_block_may_compute_for_long_in_simulation(tmp_path: Path) -> None:
    run_calibration(DrivenScanner(), tmp_path / "out", [EXPERIMENTS["rest"].plan()])
    bag = read_scan(tmp_path / "out/rest")
    assert bag.whole("achieved_displacement").x.size == bag.info.total_samples


@pytest.mark.usefixtures("slow_source")
def test_in_real_time_silence_ends_a_run_which_can_be_tried_again(tmp_path: Path) -> None:
    failed, scanner = tmp_path / "out/rest.failed", DrivenScanner(time_scale=1.0)
    said = r"(been silent|finished no sample) for 0\.\d+ s.*recorded is in .*failed"
    for _ in range(2):
        with pytest.raises(ScanError, match=said):
            run_calibration(scanner, tmp_path / "out", [EXPERIMENTS["rest"].plan()])
        assert list((tmp_path / "out").iterdir()) == [failed]
        assert read_scan(failed).info.pattern == "rest"


def test_a_drive_is_exported_at_the_rate_of_a_converter(tmp_path: Path) -> None:
    arguments = ["--experiment", "broadband", "--export", str(tmp_path), "--rate", "10kHz"]
    done = CliRunner().invoke(calibrate, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    with np.load(tmp_path / "broadband.npz") as drive:
        assert drive["sample_period_s"] == pytest.approx(1e-4)
    assert "10000 samples a second" in (tmp_path / "README.md").read_text("utf-8")


def test_the_default_drives_have_their_own_rate(tmp_path: Path) -> None:
    for words, said in ((["--out"], "give --range too"), (["--export"], "give both")):
        done = CliRunner().invoke(calibrate, ["--rate", "10kHz", *words, str(tmp_path)])
        assert done.exit_code == 2
        assert said in done.output
