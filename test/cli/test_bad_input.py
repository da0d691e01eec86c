"""Bad input of each kind: one line that names it, status 2, and never a traceback."""

import os
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.arrays import SEAL

CONFIG = share_directory() / "config"
ROOT = Path(__file__).parents[2]
FOREIGN = Path(os.environ.get("AFM_SCAN_DATA", ROOT / "../shared/data")) / "rosbag2"

Refused = Callable[..., str]


@pytest.fixture
def refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Run the command, which must end with status 2 and one line on stderr; return that line."""

    def run(*arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", ["afm-scan", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        message = capsys.readouterr().err
        assert end.value.code == 2, message
        assert message.count("\n") == 1, message
        return message

    return run


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """Files of a scan that would be done."""
    for name in ("model.yaml", "model.npz", "plant.yaml"):
        shutil.copy(CONFIG / name, tmp_path)
    spec = "/**/trajectory_generator:\n  ros__parameters:\n    range_x_um: 40.0\n"
    (tmp_path / "scan.yaml").write_text(spec, "utf-8")
    return tmp_path


def scan(folder: Path) -> list[object]:
    files = [("--spec", "scan.yaml"), ("--model", "model.yaml"), ("--plant", "plant.yaml")]
    named = [word for option, name in files for word in (option, folder / name)]
    return ["scan", *named, "--bag", folder / "bag"]


IN_YAML = [
    ("scan.yaml", "range_x_um", "range_x", "did you mean 'range_x_um'"),
    ("scan.yaml", "40.0", "-40.0", "range_x_um = -40.0"),
    ("scan.yaml", "40.0", ".nan", "range_x_um = nan"),
    ("scan.yaml", "40.0", "forty", "should be a number"),
    ("scan.yaml", "40.0", "[40.0", "line "),
    ("scan.yaml", "ros__parameters", "parameters", "must hold 'ros__parameters:'"),
    ("model.yaml", "numerator_v_per_v", "numerator", "did you mean 'numerator_v_per_v'"),
    ("model.yaml", "8.0e-06", "-8.0e-06", "sensor_sensitivity_m_per_v"),
    ("model.yaml", "arrays: ", "arrays: other_", "no such file"),
    ("plant.yaml", "x:", "ex:", "plant.yaml"),
]


@pytest.mark.parametrize(("name", "old", "new", "expected"), IN_YAML)
def test_a_wrong_file_of_a_scan(
    refused: Refused, config: Path, name: str, old: str, new: str, expected: str
) -> None:
    path = config / name
    text = re.sub(f"{SEAL}: .*\n", "", path.read_text("utf-8"))
    assert old in text
    path.write_text(text.replace(old, new, 1), "utf-8")
    message = refused(*scan(config))
    assert str(config) in message
    assert expected in message
    assert not (config / "bag").exists()


def test_a_model_that_was_cut_short(refused: Refused, config: Path) -> None:
    whole, _, _ = (config / "model.yaml").read_text("utf-8").rpartition("  known_elsewhere:")
    (config / "model.yaml").write_text(whole, "utf-8")
    message = refused(*scan(config))
    assert f"{config / 'model.yaml'}: was cut short or edited" in message
    assert "bring the whole file back" in message


@pytest.mark.parametrize("name", ["scan.yaml", "model.yaml", "model.npz", "plant.yaml"])
@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(b"")])
def test_a_missing_or_empty_file_of_a_scan(
    refused: Refused, config: Path, name: str, damage: Callable[[Path], None]
) -> None:
    damage(config / name)
    assert name in refused(*scan(config))


def test_a_surface_of_the_wrong_shape(refused: Refused, config: Path) -> None:
    arrays = dict(np.load(config / "model.npz"))
    np.savez(config / "model.npz", **(arrays | {"x_forward": np.zeros((3, 4))}))
    assert "'x_forward' should be a square" in refused(*scan(config))


def test_an_unknown_inverse(refused: Refused, config: Path) -> None:
    assert "crep" in refused(*scan(config), "--inverses", "crep")


def test_a_bag_that_is_there_already(refused: Refused, config: Path) -> None:
    (config / "bag").mkdir()
    assert "exists already" in refused(*scan(config))


BAGS = {
    "missing": lambda _: None,
    "empty folder": Path.mkdir,
    "empty file": lambda path: path.write_bytes(b""),
    "text": lambda path: path.write_text("no bag", "utf-8"),
    "cut at once": lambda path: path.write_bytes(b"\x89MCAP0\r\n"),
}


@pytest.mark.parametrize("make", BAGS.values(), ids=BAGS)
@pytest.mark.parametrize("command", ["analyze", "identify"])
def test_what_is_no_bag(
    refused: Refused, tmp_path: Path, command: str, make: Callable[[Path], None]
) -> None:
    bag = tmp_path / "scan.mcap"
    make(bag)
    given = {
        "analyze": ["analyze", bag],
        "identify": ["identify", "--creep", bag, "--frequency", bag, "--hysteresis", bag],
    }
    assert "scan.mcap" in refused(*given[command])


def test_a_calibration_record_is_no_scan(refused: Refused, tmp_path: Path) -> None:
    bag = tmp_path / "creep"
    with ScanWriter(bag, ScanInfo("s", 0, "creep", 1e-2, 10)) as writer:
        for name in ("drive_voltage", "achieved_displacement"):
            writer.add(name, Trace(0, 1e-2, np.zeros(10), np.zeros(10)))
    assert "'afm-scan identify'" in refused("analyze", bag)


@pytest.mark.skipif(not FOREIGN.is_dir(), reason=f"no foreign bags at {FOREIGN}: AFM_SCAN_DATA")
@pytest.mark.parametrize("name", ["talker", "cdr_test", "wbag", "only_topics.mcap"])
def test_a_foreign_bag(refused: Refused, name: str) -> None:
    message = refused("analyze", FOREIGN / name)
    assert name in message
    assert "scan_info" in message
