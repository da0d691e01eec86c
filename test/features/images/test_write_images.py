"""What is written for other programs is what they read: values, units, ranges and words."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import ImageChannel, image_channels, words_of
from afm_scan_ros.features.images.files.formats import read_image, write_image
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files.columns import Signal

gwyfile = pytest.importorskip("gwyfile")
gsffile = pytest.importorskip("gsffile")
h5netcdf = pytest.importorskip("h5netcdf")

FORMATS = [".gwy", ".gsf", ".nc"]


def image(seed: int, lines: int, pixels: int) -> ScanImage:
    """Return an image of any size, scale and unit."""
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-12, 3)
    trace, retrace = scale * rng.normal(size=(2, lines, pixels))
    ranges = (10.0 ** rng.uniform(-9, -3, 2)).tolist()
    unit = str(rng.choice(["m", "V", "deg"]))
    time, share = rng.uniform([1e-3, 0.0], [10.0, 0.5]).tolist()
    facts = {"line_time": time, "upward": bool(rng.integers(2)), "overscan": share, "unit": unit}
    return ScanImage(trace, retrace, *ranges, **facts, channel="Height 2")


SIZES = {"seed": st.integers(0, 2**32), "lines": st.integers(8, 15), "pixels": st.integers(8, 15)}


@settings(deadline=None, max_examples=30)
@given(**SIZES)
def test_an_image_comes_back_from_gwyddion(seed: int, lines: int, pixels: int) -> None:
    given_ = image(seed, lines, pixels)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.gwy"
        write_image(path, image_channels(given_), words_of(given_))
        found = read_image(path, "height 2")
        container = gwyfile.load(str(path))
    for side in ("trace", "retrace"):
        np.testing.assert_array_equal(getattr(found, side), getattr(given_, side))
    same = ("range_x", "range_y", "line_time", "upward", "overscan", "channel", "unit")
    assert [getattr(found, name) for name in same] == [getattr(given_, name) for name in same]
    assert found.assumptions == ()
    fields = gwyfile.util.get_datafields(container)
    assert list(fields) == ["Height 2 (trace)", "Height 2 (retrace)"]
    field = fields["Height 2 (retrace)"]
    np.testing.assert_array_equal(field.data, given_.retrace[::-1])
    assert (field.xreal, field.yreal) == (given_.range_x, given_.range_y)
    assert (field.si_unit_xy.unitstr, field.si_unit_z.unitstr) == ("m", given_.unit)


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32), size=st.integers(8, 12))
def test_topostats_reads_the_same(seed: int, size: int) -> None:
    """By AFMReader, which knows square images alone, in nm with the top first."""
    other = pytest.importorskip("AFMReader.gwy")
    given_ = image(seed, size, size)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.gwy"
        write_image(path, image_channels(given_), {**words_of(given_), "scan_id": "x"})
        values, pixel = other.load_gwy(path, "Height 2 (retrace)")
    np.testing.assert_allclose(values, 1e9 * given_.retrace[::-1], rtol=1e-15)
    assert pixel == pytest.approx(1e9 * given_.range_x / size)


@settings(deadline=None, max_examples=30)
@given(**SIZES)
def test_an_image_comes_back_from_simple_fields(seed: int, lines: int, pixels: int) -> None:
    given_ = image(seed, lines, pixels)
    with TemporaryDirectory() as folder:
        files = write_image(Path(folder) / "a.gsf", image_channels(given_), words_of(given_))
        assert [file.name for file in files] == ["a.gsf", "a_height_2_retrace.gsf"]
        values, fields = gsffile.read_gsf(files[1])
        found = read_image(files[0])
    np.testing.assert_array_equal(values, given_.retrace.astype(np.float32)[::-1])
    expected = {
        "XReal": given_.range_x,
        "YReal": given_.range_y,
        "Title": "Height 2 (retrace)",
        "XYUnits": "m",
        "ZUnits": given_.unit,
        **words_of(given_),
    }
    assert expected.items() <= fields.items()
    np.testing.assert_array_equal(found.trace, given_.trace.astype(np.float32))
    assert (found.line_time, found.upward) == (given_.line_time, given_.upward)
    assert found.retrace is None


@pytest.mark.evidence
@settings(deadline=None, max_examples=20)
@given(**SIZES)
def test_variables_of_netcdf(seed: int, lines: int, pixels: int) -> None:
    xarray = pytest.importorskip("xarray")
    given_ = image(seed, lines, pixels)
    channels = [
        *image_channels(given_),
        ImageChannel("Small", "V", np.ones((3, 4)), 4.0, 3.0, left=-2.0, bottom=5.0),
    ]
    signals = [Signal("time", "s", np.arange(5.0)), Signal("drive_x", "V", np.arange(5.0) ** 2)]
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.nc"
        write_image(path, channels, {"scan_id": "scan 1"}, signals)
        with xarray.open_dataset(path, engine="h5netcdf") as data:
            found = data.load()
    trace = found["height_2_trace"]
    np.testing.assert_array_equal(trace, given_.trace)
    assert trace.dims == ("y", "x")
    assert trace.attrs == {"units": given_.unit, "long_name": "Height 2 (trace)"}
    for axis, extent in (("x", given_.range_x), ("y", given_.range_y)):
        assert found[axis].attrs["units"] == "m"
        step = extent / found[axis].size
        np.testing.assert_allclose(found[axis], step * (np.arange(found[axis].size) + 0.5))
    assert found["small"].dims == ("y2", "x2")
    np.testing.assert_allclose(found["x2"], [-1.5, -0.5, 0.5, 1.5])
    np.testing.assert_allclose(found["y2"], [5.5, 6.5, 7.5])
    np.testing.assert_array_equal(found["drive_x"], signals[1].values)
    assert (found["drive_x"].units, found.attrs["scan_id"]) == ("V", "scan 1")


CHANNEL = ImageChannel("Height", "m", np.ones((3, 4)), 4e-6, 3e-6)
LARGE = ImageChannel("Height", "m", np.full((3, 4), 1e300), 4e-6, 3e-6)
TIME = Signal("time", "s", np.arange(3.0))
REFUSED = [
    (".png", [CHANNEL], {}, [], "no format of images to write: give .gwy, .gsf, .nc"),
    (".gwy", [], {}, [], "nothing to write: give at least one channel"),
    (".gwy", [CHANNEL], {}, [TIME], "holds no signals: write them to .nc or .csv"),
    (".gsf", [CHANNEL], {}, [TIME], "holds no signals: write them to .nc or .csv"),
    (".gwy", [CHANNEL], {"a": "b\0"}, [], "'a' holds a zero byte: leave it out"),
    (".gsf", [CHANNEL], {"a": "b=c"}, [], "a holds '=' or a line end: leave it out"),
    (".gsf", [CHANNEL], {"a": "b\nc"}, [], "a holds '=' or a line end: leave it out"),
    (".gsf", [LARGE], {}, [], "a value is too large for 32 bits: write .gwy or .nc"),
    (".gsf", [CHANNEL, CHANNEL, CHANNEL], {}, [], "two channels would be in"),
    (".nc", [CHANNEL, CHANNEL], {}, [], "two variables would be named 'height': rename"),
]


@pytest.mark.parametrize(("suffix", "channels", "stated", "signals", "says"), REFUSED)
def test_what_a_format_cannot_hold(
    suffix: str,
    channels: list[ImageChannel],
    stated: dict[str, str],
    signals: list[Signal],
    says: str,
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError) as found:
        write_image(tmp_path / f"a{suffix}", channels, stated, signals)
    assert says in str(found.value)
    assert str(found.value).startswith(str(tmp_path / "a"))
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("suffix", FORMATS)
def test_no_file_is_overwritten(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / "made" / f"a{suffix}"
    last = write_image(path, [CHANNEL, ImageChannel("Error", "m", np.ones((3, 4)), 1.0, 1.0)])[-1]
    before = last.read_bytes()
    if last != path:
        path.unlink()
    with pytest.raises(InputError, match="exists already: give another file or remove it"):
        write_image(path, [CHANNEL, ImageChannel("Error", "m", np.zeros((3, 4)), 1.0, 1.0)])
    assert last.read_bytes() == before
    assert path.exists() == (last == path)


def test_a_channel_without_gaps() -> None:
    values = np.ones((3, 4))
    values[1, 2] = np.nan
    with pytest.raises(InputError, match=r"^Height \(trace\): not a finite .* line 1, pixel 2"):
        ImageChannel("Height", "m", values, 1.0, 1.0, "trace")
    with pytest.raises(InputError, match="give a plane"):
        ImageChannel("Height", "m", np.ones(3), 1.0, 1.0)


def test_an_image_without_retrace_is_one_channel() -> None:
    (only,) = image_channels(ScanImage(np.ones((8, 8)), None, 1e-6, 2e-6))
    assert (only.title, only.range_x, only.range_y) == ("Topography (trace)", 1e-6, 2e-6)
