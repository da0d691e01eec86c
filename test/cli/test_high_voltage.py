"""A scanner whose amplifier gives more than the simulated one: its own limits hold, no others."""

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.main import cli
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.files import share_directory, yaml
from afm_scan_ros.files.model_file import save_model
from afm_scan_ros.report.analysis import analyse
from helpers.in_process import default_model
from helpers.scaling import scaled_axis

TIMES = 30.0
"""Voltages of the scanner over those of config/plant.yaml: 150 V in place of 5."""
SCAN = """\
/**/trajectory_generator:
  ros__parameters: {line_rate_hz: 30.0, lines: 4, samples_per_line: 1000, preparation_cycles: 5}
"""


def raised(plant: dict[str, Any]) -> dict[str, Any]:
    """The same scanner behind an amplifier that needs so many times the voltage."""
    for name in plant["amplifier"]:
        plant["amplifier"][name] *= TIMES
    for axis in ("x", "y"):
        hysteresis, vibration = plant[axis]["hysteresis"], plant[axis]["vibration"]
        for name in filter(lambda name: name.endswith("_v"), hysteresis):
            hysteresis[name] *= 1.0 / TIMES if name.endswith("_per_v") else TIMES
        vibration["numerator"] = [each / TIMES for each in vibration["numerator"]]
    return plant


@pytest.mark.parametrize("volts", [150.0, 100.0])
def test_the_limits_of_a_scan_are_those_of_its_scanner(tmp_path: Path, volts: float) -> None:
    plant = raised(yaml.load(share_directory() / "config/plant.yaml"))
    plant["amplifier"]["voltage_limit_v"] = volts
    files = {name: tmp_path / name for name in ("plant.yaml", "model.yaml", "scan.yaml", "bag")}
    yaml.save(files["plant.yaml"], plant, "A scanner.")
    model = default_model()
    axes = (scaled_axis(model.axis(name), Scale(1.0, TIMES, 1.0)) for name in ("x", "y"))
    save_model(files["model.yaml"], ScannerModel(*axes), "Its model.")
    files["scan.yaml"].write_text(SCAN, "utf-8")
    words = [f"--{name}={files[f'{name}.yaml']}" for name in ("plant", "model")]
    words += [f"--spec={files['scan.yaml']}", f"--bag={files['bag']}"]
    done = CliRunner().invoke(cli, ["scan", *words])
    if volts < 103.0:  # 3.44 V for the scan of 40 µm, thirty times
        assert "is beyond the amplifier's 100" in str(done.exception)
        return
    assert done.exit_code == 0, done.output
    true = analyse(read_scan(files["bag"])).true
    assert true is not None
    assert true.x.constant_speed is not None
    assert true.x.constant_speed.rms_share < 1e-3
