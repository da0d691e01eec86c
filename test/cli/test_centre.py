"""A scan about another place than rest: its drive, its error, and its images."""

from pathlib import Path

import pytest
from attrs import evolve
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import decode_info, encode_info
from afm_scan_ros.cli.main import cli
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.features.images.export_command import scan_channels
from afm_scan_ros.report.analysis import analyse

SCAN = """\
/**/trajectory_generator:
  ros__parameters: {range_x_um: 10.0, range_y_um: 6.0, centre_x_um: 12.0, centre_y_um: -9.0,
    line_rate_hz: 20.0, lines: 4, samples_per_line: 1000, preparation: %s}
"""


@pytest.mark.parametrize("preparation", ["depolarise", "none"])
def test_a_scan_about_a_centre_is_as_good_and_lies_where_it_was(
    tmp_path: Path, preparation: str
) -> None:
    spec, bag = (str(tmp_path / name) for name in ("scan.yaml", "bag"))
    Path(spec).write_text(SCAN % preparation, "utf-8")
    done = CliRunner().invoke(cli, ["scan", "--spec", spec, "--bag", bag])
    assert done.exit_code == 0, done.output
    recording = read_scan(Path(bag))
    assert recording.info.spec is not None
    assert (recording.info.spec.centre_x, recording.info.spec.centre_y) == (12e-6, -9e-6)
    true = analyse(recording).true
    assert true is not None
    for axis in (true.x, true.y):
        assert axis.constant_speed is not None
        assert axis.constant_speed.rms_share < 5e-3
    image = scan_channels(recording, recording.info.spec)[0]
    assert (image.left, image.range_x) == pytest.approx((7e-6, 10e-6))
    assert image.bottom + 0.5 * image.range_y == pytest.approx(-9e-6)


def test_a_scan_info_of_before_there_were_centres_is_read() -> None:
    spec = ScanSpec(centre_x=1e-6, centre_y=2e-6)
    for names in (("a",), ("a", "bb"), ("ccc",), ("a", "dddd"), ("eeeee",)):
        whole = encode_info(evolve(info_of_scan(spec, "one", 5), nodes=names))
        assert decode_info(whole).spec == spec
        earlier = whole[: len(whole) - 2 * 8].rstrip(b"\0") + b"\0"
        for padding in {0, -len(earlier) % 4}:
            found = decode_info(earlier + bytes(padding))
            assert found.spec == ScanSpec()
            assert found.nodes == names
    with pytest.raises(InputError, match="scan_info: not a"):
        decode_info(whole[: len(whole) - 4 * 8])
