"""A scan is given as a ROS parameter file of the trajectory generator."""

from pathlib import Path

import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_scan


def written(folder: Path, text: str) -> Path:
    path = folder / "scan.yaml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "section",
    ["/**", "/**/trajectory_generator", "/trajectory_generator", "trajectory_generator"],
)
def test_every_name_by_which_ros_finds_the_node_is_read(tmp_path: Path, section: str) -> None:
    path = written(tmp_path, f"{section}:\n  ros__parameters:\n    range_x_um: 12.5\n")
    assert load_scan(path) == (ScanSpec(range_x=12.5e-6), {})


def test_other_nodes_are_left_alone_and_the_later_section_wins(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "/**: {ros__parameters: {lines: 4, time_scale: 1.0}}\n"
        "/**/scan_recorder: {ros__parameters: {bag: somewhere}}\n"
        "/**/trajectory_generator: {ros__parameters: {lines: 6}}\n",
    )
    assert load_scan(path, ["time_scale"]) == (ScanSpec(lines=6), {"time_scale": 1.0})


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("range_x_um: 4.0", "begin it with '/\\*\\*/trajectory_generator:'"),
        ("/**: {range_x_um: 4.0}", "must hold 'ros__parameters:'"),
        ("/**: {ros__parameters: {}, lines: 4}", "unknown key 'lines'"),
        ("/**: {ros__parameters: {range_x: 4.0}}", "did you mean 'range_x_um'"),
        ("/**: {ros__parameters: {range_x_um: -4.0}}", "range_x_um = -4.0 is out of range"),
        ("/**: {ros__parameters: {range_x_um: 4}}", "should be a number with a point"),
        ("/**: {ros__parameters: {line_rate_hz: nan}}", "not finite"),
        ("/**: {ros__parameters: {line_rate_hz: 1e308}}", "inf samples a second: give at most"),
        ("/**: {ros__parameters: {samples_per_line: 10000000}}", "5e.07 samples a second"),
        ("/**: {ros__parameters: {samples_per_line: 1000000000}}", "is out of range"),
        ("/**: {ros__parameters: {lines: 9223372036854775807}}", "samples: give at most 1e.12"),
        ("/**: {ros__parameters: {settle_s: 1e308}}", "samples: give at most 1e.12"),
        ("/**: {ros__parameters: {preparation_rate_hz: 1e-308}}", "samples: give at most 1e.12"),
        ("/**: {ros__parameters: {pattern: off}}", "pattern = False should be text"),
        ("/**: {ros__parameters: {time_scale: 1.0}}", "unknown key 'time_scale'"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, reason: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=reason) as refusal:
        load_scan(path)
    assert str(refusal.value).startswith(str(path))


def test_the_share_directory_holds_what_nodes_need() -> None:
    assert (share_directory() / "msg/ScanInfo.msg").is_file()
