"""Recordings of others are imported as their files state them."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_bench.measured.recordings import VARIABLE, measured_data
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.import_csv import import_csv
from afm_scan_ros.core.errors import InputError


def test_the_micromanipulators_record(tmp_path: Path) -> None:
    try:
        file = measured_data("piezo_micromanipulator/Test_Vi_Do_Di.dat")
    except InputError as error:
        pytest.skip(f"{VARIABLE}: {error}")
    columns = "drive_x=1:V,achieved_x=5:um,desired_x=9:um"
    arguments = [str(file), "--columns", columns, "--sample-rate", "200"]
    bag_path = tmp_path / "bag"
    CliRunner().invoke(import_csv, [*arguments, "--bag", str(bag_path)], catch_exceptions=False)
    bag = read_scan(bag_path)
    numbers = np.loadtxt(file)
    assert bag.info.pattern == "imported_x_only"
    for stream, column, scale in (
        ("drive_voltage", 0, 1.0),
        ("achieved_displacement", 4, 1e-6),
        ("desired_displacement", 8, 1e-6),
    ):
        np.testing.assert_allclose(bag.whole(stream).x, scale * numbers[:, column], rtol=1e-12)
        assert not bag.whole(stream).y.any()
