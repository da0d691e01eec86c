"""``afm-scan export``: other programs read what a bag holds of a scan."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from click.testing import CliRunner

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.typestore import encode
from afm_scan_ros.bag.writer import ScanWriter, write_record
from afm_scan_ros.cli.import_csv import import_csv
from afm_scan_ros.cli.main import main
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.image_lines import frame_of
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.features.images.export_command import export
from afm_scan_ros.features.images.files.formats import read_image
from afm_scan_ros.files import version

for needed in ("gwyfile", "gsffile", "h5netcdf"):  # an extra, which a ROS machine need not have
    pytest.importorskip(needed)

SPEC = ScanSpec(
    range_x=10e-6,
    range_y=8e-6,
    line_rate=20.0,
    lines=9,
    samples_per_line=400,
    overscan=0.1,
    preparation="none",
    approach=0.01,
    settle=0.01,
)
GAIN, OFFSET = 1.01, 2e-9
PIXELS = int(0.5 * 400 * 0.8) - 1  # as many as a trace has samples for


def streams(samples: int) -> dict[str, Trace]:
    """Return a scan whose x has another gain and whose y another origin."""
    target = desired(SPEC, 0, samples)
    achieved = Trace(0, SPEC.sample_period, GAIN * target.x, target.y + OFFSET)
    drive = Trace(0, SPEC.sample_period, 1e5 * target.x, 1e5 * target.y)
    return {
        "desired_displacement": target,
        "drive_voltage": drive,
        "achieved_displacement": achieved,
    }


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    info = info_of_scan(SPEC, "scan 7", start=1_700_000_000_000_000_000)
    write_record(tmp_path / "bag", info, streams(total_samples(SPEC)))
    return tmp_path / "bag"


def run(bag: Path, target: Path, *options: str) -> str:
    words = [str(bag), "--to", str(target), *options]
    result = CliRunner().invoke(export, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def incomplete(bag: Path, target: Path) -> str:
    """Export what there is of a scan, which ends as 'afm-scan analyze' of it does."""
    with pytest.raises(ScanError, match=f"^{bag}: the scan is incomplete: ") as end:
        CliRunner().invoke(export, [str(bag), "--to", str(target)], catch_exceptions=False)
    assert target.exists()
    return str(end.value)


def test_errors_and_positions_at_the_desired_ones(bag: Path, tmp_path: Path) -> None:
    said = run(bag, tmp_path / "a.gwy")
    assert f"Error x, Error y, Achieved x, Achieved y: 9 lines of {PIXELS} pixels" in said
    x = frame_of(SPEC, PIXELS).centres
    y = np.linspace(-4e-6, 4e-6, 9)
    error = read_image(tmp_path / "a.gwy", "Error x")
    assert error.retrace is not None
    for values in (error.trace, error.retrace):  # a mean over a pixel, which samples quantise
        np.testing.assert_allclose(values, np.tile((GAIN - 1.0) * x, (9, 1)), atol=2e-9)
    error = read_image(tmp_path / "a.gwy", "Error y")
    np.testing.assert_allclose(error.trace, OFFSET)
    achieved = read_image(tmp_path / "a.gwy", "Achieved y")
    inner = slice(20, -20)  # y steps at the end of a trace
    expected = np.tile(y + OFFSET, (PIXELS, 1)).T
    np.testing.assert_allclose(achieved.trace[:, inner], expected[:, inner], rtol=1e-6)
    assert (achieved.line_time, achieved.upward, achieved.unit) == (0.05, True, "m")
    assert achieved.overscan == pytest.approx(0.1 / 0.8)
    assert achieved.range_x == pytest.approx(8e-6)
    assert achieved.range_y == pytest.approx(9e-6)


def test_the_provenance_is_stated(bag: Path, tmp_path: Path) -> None:
    import gwyfile  # noqa: PLC0415 - an extra

    run(bag, tmp_path / "a.gwy")
    meta = gwyfile.load(str(tmp_path / "a.gwy"))["/3/meta"]
    expected = {
        "written_by": f"afm_scan_ros {version()}",
        "scan_id": "scan 7",
        "recorded": "2023-11-14T22:13:20Z",
        "model_hash": "none",
        "scan_pattern": "raster",
        "scan_range_x_um": "10.0",
        "scan_lines": "9",
        "sample_rate_hz": "8000.0",
    }
    assert expected.items() <= meta.items()


def test_a_table_is_read_back(bag: Path, tmp_path: Path) -> None:
    run(bag, tmp_path / "a.csv")
    words = [str(tmp_path / "a.csv"), "--bag", str(tmp_path / "again")]
    result = CliRunner().invoke(import_csv, words, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    first, again = read_scan(bag), read_scan(tmp_path / "again")
    assert again.info.sample_period == pytest.approx(SPEC.sample_period, rel=1e-9)
    for name in first.topics:
        for axis in ("x", "y"):
            one, other = (each.whole(name).axis(axis) for each in (first, again))
            np.testing.assert_array_equal(one, other)


def test_netcdf_holds_images_and_signals(bag: Path, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    run(bag, tmp_path / "a.nc", "--pixels", "50")
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as data:
        assert data["error_x_retrace"].shape == (9, 50)
        np.testing.assert_allclose(data["x"], frame_of(SPEC, 50).centres)
        np.testing.assert_allclose(data["y"], np.linspace(-4e-6, 4e-6, 9), atol=1e-18)
        samples = streams(total_samples(SPEC))
        np.testing.assert_array_equal(data["drive_y"], samples["drive_voltage"].y)
        np.testing.assert_allclose(np.diff(data["time"]), SPEC.sample_period)
        units = {name: data[name].units for name in ("time", "drive_x", "desired_y", "x")}
        assert units == {"time": "s", "drive_x": "V", "desired_y": "m", "x": "m"}


def test_simple_fields_are_one_a_file(bag: Path, tmp_path: Path) -> None:
    said = run(bag, tmp_path / "a.gsf")
    assert len([*tmp_path.glob("a*.gsf")]) == 8
    assert f"{tmp_path / 'a_achieved_y_retrace.gsf'} holds Achieved y (retrace)" in said
    assert read_image(tmp_path / "a_achieved_y_trace.gsf").channel == "Achieved y"


IMAGE = "sensor_msgs/msg/Image"
HEIGHTS = np.random.default_rng(0).normal(size=(2, 9, 30)).astype(np.float32)


def add_images(writer: ScanWriter, encoding: str = "32FC1", space: str = "") -> None:
    """Add what an imager shows: the last message of each topic holds all lines."""
    for way, image in zip(("trace", "retrace"), HEIGHTS, strict=True):
        topic = f"{space}/scan_image/{way}"
        writer.add_topic(topic, IMAGE, latched=True)
        for lines, rows in ((4, image[:4]), (9, 0.0 * image), (9, image)):
            shown = np.frombuffer(rows.tobytes(), np.uint8)
            fields = {"encoding": encoding, "is_bigendian": 0, "data": shown}
            fields |= {"height": lines, "width": 30, "step": 120}
            writer.write(topic, 0, encode(IMAGE, 0, fields))


def imaged(
    folder: Path,
    *spaces: str,
    encoding: str = "32FC1",
    without: Sequence[str] = (),
    spec: ScanSpec = SPEC,
) -> Path:
    """Return a bag of a scan with images in some namespaces, and without some streams."""
    with ScanWriter(folder, info_of_scan(spec, "scan", start=0)) as writer:
        for space in spaces:
            add_images(writer, encoding, space)
        for name, trace in streams(total_samples(spec)).items():
            if name not in without:
                writer.add(name, trace)
    return folder


def test_a_recorded_image_comes_first(tmp_path: Path) -> None:
    said = run(imaged(tmp_path / "bag", "/lab"), tmp_path / "a.gwy")
    assert "holds Topography, Error x" in said
    found = read_image(tmp_path / "a.gwy")
    assert found.channel == "Topography"
    np.testing.assert_array_equal(found.trace, HEIGHTS[0])
    np.testing.assert_array_equal(found.retrace, HEIGHTS[1])
    assert read_image(tmp_path / "a.gwy", "error x").pixels == 30
    said = run(tmp_path / "bag", tmp_path / "a.gsf")
    assert said.startswith(f"{tmp_path / 'a.gsf'} holds Topography (trace).\n")


def test_a_stopped_scan_has_the_lines_that_are_whole(tmp_path: Path) -> None:
    info = info_of_scan(SPEC, "scan", start=0)
    samples = phases(SPEC).lines.start + 8 * SPEC.samples_per_line + 7
    with ScanWriter(tmp_path / "bag", info) as writer:
        for name, trace in streams(samples).items():
            writer.add(name, trace)
    said = incomplete(tmp_path / "bag", tmp_path / "a.gwy")
    assert "8 of 9 lines of the scan are whole" in said
    assert read_image(tmp_path / "a.gwy", "Error x").range_y == pytest.approx(8e-6)
    said = incomplete(tmp_path / "bag", tmp_path / "a.csv")
    assert f"the last {total_samples(SPEC) - samples} samples are missing" in said


def record(folder: Path) -> Path:
    """Return a bag of a record that is no scan, without desired displacement."""
    given = streams(2000)
    del given["desired_displacement"]
    write_record(folder, ScanInfo("creep", 0, "creep", SPEC.sample_period, 2000), given)
    return folder


def test_a_record_has_signals_alone(tmp_path: Path) -> None:
    said = run(record(tmp_path / "bag"), tmp_path / "a.nc")
    assert said == f"{tmp_path / 'a.nc'} holds 2000 samples of each signal.\n"
    run(tmp_path / "bag", tmp_path / "a.csv")
    heading = (tmp_path / "a.csv").read_text("utf-8").split("\n")[0]
    assert heading == "time [s],achieved_x [m],achieved_y [m],drive_x [V],drive_y [V]"


@pytest.mark.parametrize("name", ["desired_displacement", "achieved_displacement"])
def test_a_scan_without_a_displacement_has_what_is_there(name: str, tmp_path: Path) -> None:
    said = run(imaged(tmp_path / "bag", without=[name]), tmp_path / "a.nc")
    assert said.endswith(
        f"{tmp_path / 'a.nc'} holds {total_samples(SPEC)} samples of each signal.\n"
    )
    assert f"holds no {name}, so there are no images of errors" in said
    said = run(imaged(tmp_path / "imaged", "/lab", without=[name]), tmp_path / "a.gwy")
    assert "holds Topography: 9 lines of 30 pixels.\n" in said
    np.testing.assert_array_equal(read_image(tmp_path / "a.gwy").trace, HEIGHTS[0])


def test_a_pattern_without_lines_has_signals_alone(tmp_path: Path) -> None:
    spec = evolve(SPEC, pattern="spiral")
    said = run(imaged(tmp_path / "bag", spec=spec), tmp_path / "a.nc")
    assert said == f"{tmp_path / 'a.nc'} holds {total_samples(spec)} samples of each signal.\n"


Made = Callable[[Path], Path]
REFUSED: list[tuple[Made, str, list[str], str]] = [
    (record, "a.gwy", [], "scan_info calls it 'creep', which is not a scan"),
    (
        lambda folder: imaged(folder, without=["desired_displacement"]),
        "a.gwy",
        [],
        "holds no desired_displacement: record it too, or export signals to .nc or .csv",
    ),
    (record, "a.png", [], "a.png: unknown format: give .gwy, .gsf, .nc, .csv"),
    (record, "a.csv", ["--pixels", "9"], "--pixels 9: a table holds no image: leave it out"),
    (record, "there.csv", [], "there.csv exists already: give another file or remove it"),
    (
        lambda folder: imaged(folder, ""),
        "a.gwy",
        ["--pixels", "31"],
        "its image has 30 pixels in a line, not 31: leave the number of pixels out",
    ),
    (imaged, "a.gwy", ["--pixels", "160"], "a trace has 160 samples"),
    (
        lambda folder: imaged(folder, "/a", "/b"),
        "a.gwy",
        [],
        "both /a/scan_image/trace and /b/scan_image/trace: record one scan a bag",
    ),
    (
        lambda folder: imaged(folder, "", encoding="rgb8"),
        "a.gwy",
        [],
        "/scan_image/trace: no image of heights",
    ),
]


@pytest.mark.parametrize(("make", "target", "options", "says"), REFUSED)
def test_what_cannot_be_exported(
    make: Made,
    target: str,
    options: list[str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "there.csv").write_text("mine", "utf-8")
    words = ["export", str(make(tmp_path / "bag")), "--to", str(tmp_path / target), *options]
    monkeypatch.setattr(sys, "argv", ["afm-scan", *words])
    with pytest.raises(SystemExit) as end:
        main()
    message = capsys.readouterr().err
    assert (end.value.code, message.count("\n")) == (2, 1), message
    assert says in message
    assert (tmp_path / "there.csv").read_text("utf-8") == "mine"
    assert not (tmp_path / "a.gwy").exists()
