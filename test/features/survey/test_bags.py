"""Bags in folders: found at any depth, known again, and each of an instrument."""

import os
import re
from pathlib import Path

import pytest
import yaml

from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.features.survey.assignment import found_bags, instrument_of

INFO = ScanInfo("one", 0, "creep", 1e-3, 10)


def bag(folder: Path) -> Path:
    with ScanWriter(folder, INFO):
        pass
    return folder


def paths(*given: Path) -> list[Path]:
    return [found.path for found in found_bags(given)]


def test_bags_are_found_at_any_depth(tmp_path: Path) -> None:
    one, two = bag(tmp_path / "a/night_1"), bag(tmp_path / "b/2026/night_2")
    (tmp_path / "b/notes.txt").write_text("nothing", "utf-8")
    assert paths(tmp_path) == [one, two]
    assert paths(one, tmp_path) == [one, two]
    (file,) = one.glob("*.mcap")
    assert paths(file) == [file]


def test_a_bag_that_was_not_finished_is_found_and_is_not_complete(tmp_path: Path) -> None:
    folder = bag(tmp_path / "night")
    assert [found.complete for found in found_bags([folder, *folder.glob("*.mcap")])] == [True] * 2
    (folder / "metadata.yaml").unlink()
    (file,) = folder.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-8])
    assert [found.complete for found in found_bags([folder, file])] == [False] * 2


def test_what_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        found_bags([tmp_path / "none"])
    (tmp_path / "table.csv").write_text("1", "utf-8")
    with pytest.raises(InputError, match="is no bag"):
        found_bags([tmp_path / "table.csv"])


def test_a_bag_is_known_again_until_its_files_change(tmp_path: Path) -> None:
    folder = bag(tmp_path / "night")
    (before,) = found_bags([folder])
    assert found_bags([tmp_path]) == [before]
    (file,) = folder.glob("*.mcap")
    os.utime(file, ns=(1, 1))
    (after,) = found_bags([folder])
    assert (after.name, after.identity != before.identity) == (before.name, True)


def test_a_bag_whose_files_are_being_renamed_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = bag(tmp_path / "night")
    there = [*folder.iterdir(), folder / "metadata.yaml.unfinished"]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(there))
    assert found_bags([folder]) == []


def test_the_instrument_is_the_folder_that_the_bag_lies_in(tmp_path: Path) -> None:
    assert instrument_of(bag(tmp_path / "afm_1/night")) == "afm_1"


def test_the_instrument_is_what_the_metadata_states(tmp_path: Path) -> None:
    """As 'ros2 bag record --custom-data instrument=afm_2' writes it."""
    folder = bag(tmp_path / "afm_1/night")
    content = yaml.safe_load((folder / "metadata.yaml").read_text("utf-8"))
    content["rosbag2_bagfile_information"]["custom_data"] = {"instrument": "afm_2"}
    (folder / "metadata.yaml").write_text(yaml.safe_dump(content), "utf-8")
    assert instrument_of(folder) == "afm_2"


def test_a_rule_tells_the_instrument_from_the_path(tmp_path: Path) -> None:
    folder = bag(tmp_path / "2026/afm_7_morning")
    assert instrument_of(folder, re.compile(r"/(afm_\d+)_[^/]*$")) == "afm_7"
    with pytest.raises(InputError, match="is not found in this path"):
        instrument_of(folder, re.compile("(stm)"))
