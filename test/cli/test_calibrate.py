"""``afm-scan calibrate --experiment`` records that experiment alone, in a bag of its name."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.calibrate import calibrate
from afm_scan_ros.cli.in_process import drive_through
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.files.share import share_directory
from helpers.in_process import default_plant

PLANT = share_directory() / "config/plant.yaml"


def test_bag_holds_the_experiment_as_the_process_itself_would_record_it(tmp_path: Path) -> None:
    arguments = ["--experiment", "rest", "--out", str(tmp_path)]
    done = CliRunner().invoke(calibrate, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    command = f"afm-scan diagnose BAG... {tmp_path / 'rest'} --model"
    assert f"together with the bags that left a doubt: {command}" in done.output
    assert f"recorded the simulated scanner of {PLANT} in {tmp_path}" in done.output
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


def test_every_experiment_is_told_of() -> None:
    said = CliRunner().invoke(calibrate, ["--help"]).output
    for name in EXPERIMENTS:
        assert f"  {name}: " in said


def test_help_says_which_scanner_is_driven() -> None:
    said = CliRunner().invoke(calibrate, ["--help"]).output
    assert "[default: (config/plant.yaml)]" in " ".join(said.split())
