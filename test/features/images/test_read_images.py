"""Images of every format have one orientation, and their ranges, time and direction in SI units."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.files.channels import (
    Direction,
    ScanFacts,
    chosen,
    image_of,
    paired,
    split_title,
)
from afm_scan_ros.features.images.files.formats import FORMATS, read_image
from afm_scan_ros.features.images.scan_image import ScanImage
from helpers.image_files import STEP, WRITERS, Scan

for needed in ("NSFopen", "pySPM", "igor2"):  # an extra, which a ROS machine need not have
    pytest.importorskip(needed)


def pair(seed: int, lines: int, pixels: int, *, upward: bool = True) -> Scan:
    rng = np.random.default_rng(seed)
    trace, retrace = STEP * rng.integers(-30000, 30000, (2, lines, pixels))
    facts = rng.uniform([1e-6, 1e-6, 0.01], [1e-4, 1e-4, 10.0]).tolist()
    return Scan(trace, retrace, *facts, upward)


@pytest.mark.parametrize("suffix", WRITERS)
@settings(deadline=None, max_examples=15)
@given(
    seed=st.integers(0, 2**32),
    lines=st.integers(8, 20),
    pixels=st.integers(8, 20),
    upward=st.booleans(),
)
def test_an_image_is_what_was_scanned(
    suffix: str, seed: int, lines: int, pixels: int, *, upward: bool
) -> None:
    scan = pair(seed, lines, pixels, upward=upward)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"scan{suffix}"
        WRITERS[suffix](path, scan)
        image = read_image(path)
    np.testing.assert_allclose(image.trace, scan.trace, rtol=1e-6, atol=STEP * 1e-6)
    np.testing.assert_allclose(image.retrace, scan.retrace, rtol=1e-6, atol=STEP * 1e-6)
    expected = (scan.range_x, scan.range_y, scan.line_time)
    assert (image.range_x, image.range_y, image.line_time) == pytest.approx(expected, rel=1e-9)
    assert (image.upward, image.unit) == (upward, "m")
    assert image.overscan == pytest.approx(0.05 if suffix == ".nid" else 0.0)
    stated = "states no overscan" in " ".join(image.assumptions)
    assert stated == (suffix != ".nid")


@pytest.mark.parametrize("suffix", [".sxm", ".spm", ".ibw"])
@pytest.mark.parametrize("angle", [30.0, -90.0, 180.0])
def test_rotated_lines_are_told(tmp_path: Path, suffix: str, angle: float) -> None:
    path = tmp_path / f"scan{suffix}"
    WRITERS[suffix](path, evolve(pair(1, 9, 11), angle=angle))
    told = f"its lines are rotated by {angle:g}° from the scanner's x"
    assert told in " ".join(read_image(path).assumptions)


@pytest.mark.parametrize(("angle", "told"), [(6.0, False), (7.0, True)])
def test_a_rotation_that_stays_within_a_line_is_none(
    tmp_path: Path, angle: float, *, told: bool
) -> None:
    """Of nine lines in a square, a line at 6° rises by 0.94 of their distance."""
    path, scan = tmp_path / "scan.sxm", evolve(pair(1, 9, 11), range_x=1e-6, range_y=1e-6)
    WRITERS[".sxm"](path, evolve(scan, angle=angle))
    assert ("rotated" in " ".join(read_image(path).assumptions)) is told


def test_a_trace_that_is_not_as_long_as_its_retrace_is_told(tmp_path: Path) -> None:
    WRITERS[".sxm"](tmp_path / "scan.sxm", pair(1, 9, 11))
    told = "its trace takes 25 % of the time of a line, its retrace the rest: both are taken as"
    assert told in " ".join(read_image(tmp_path / "scan.sxm").assumptions)


@pytest.mark.parametrize(("suffix", "channel"), [(".spm", "Height"), (".ibw", "HeightTrace")])
def test_rows_are_those_of_another_reader(tmp_path: Path, suffix: str, channel: str) -> None:
    """AFMReader has the top row first, and nm."""
    modules = {".spm": "AFMReader.spm", ".ibw": "AFMReader.ibw"}
    other = pytest.importorskip(modules[suffix])
    path = tmp_path / f"scan{suffix}"
    WRITERS[suffix](path, pair(0, 12, 12))
    values, _ = getattr(other, f"load_{suffix[1:]}")(path, channel)
    found = 1e9 * read_image(path).trace[::-1]
    np.testing.assert_allclose(values, found, rtol=1e-6)


def test_pixels_are_square_where_a_bruker_states_no_ratio(tmp_path: Path) -> None:
    path = tmp_path / "captured.spm"
    WRITERS[".spm"](path, pair(0, 12, 16))
    other = b"Aspect Ratio: 0.516184"
    content = re.sub(rb"Aspect Ratio: \S+", lambda it: other.ljust(len(it[0])), path.read_bytes())
    path.write_bytes(content)
    image = read_image(path)
    assert image.range_y == pytest.approx(image.range_x * 12 / 16)


def npz(path: Path, **further: object) -> Path:
    rng = np.random.default_rng(0)
    given_ = {"trace": rng.normal(size=(9, 11)), "range_x": 2e-6, "range_y": 1e-6}
    np.savez(path, **(given_ | further))
    return path


def test_arrays_of_an_archive(tmp_path: Path) -> None:
    retrace = np.arange(99.0).reshape(9, 11)
    facts = {"line_time": 0.5, "upward": False, "overscan": 0.1, "channel": "Z", "unit": "nm"}
    image = read_image(npz(tmp_path / "a.npz", retrace=retrace, **facts))
    np.testing.assert_allclose(image.retrace, 1e-9 * retrace)
    found = (image.line_time, image.upward, image.overscan, image.channel, image.unit)
    assert found == (0.5, False, 0.1, "Z", "m")
    assert image.assumptions == ()
    bare = read_image(npz(tmp_path / "b.npz"))
    assert (bare.retrace, bare.line_time, bare.upward, bare.unit) == (None, None, True, "m")
    assert len(bare.assumptions) == 2


def test_arrays_need_no_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NSFopen", "gwyfile", "gsffile", "pySPM", "igor2", "pandas", "h5py"):
        monkeypatch.setitem(sys.modules, name, None)
    assert read_image(npz(tmp_path / "a.npz")).trace.shape == (9, 11)


@pytest.mark.parametrize("suffix", [s for s in FORMATS if FORMATS[s].needed != "numpy"])
def test_a_missing_package_is_named(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = FORMATS[suffix].needed.split(".")[0]
    for name in [n for n in sys.modules if n.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / f"a{suffix}").write_bytes(b"")
    said = rf"a{suffix}: {package} is needed .*: pip install 'afm_scan_ros\[images\]'$"
    with pytest.raises(InputError, match=said):
        read_image(tmp_path / f"a{suffix}")


TITLES = {
    "HeightRetrace": ("Height", True),
    "HeightTracee": ("Height", False),
    "Z-Axis backward": ("Z-Axis", True),
    "Z (Forward)": ("Z", False),
    "Topography [bwd]": ("Topography", True),
    "Topography": ("Topography", False),
    "Trace": ("Trace", False),
}


@pytest.mark.parametrize("title", TITLES)
def test_a_title_states_the_direction(title: str) -> None:
    assert split_title(title) == TITLES[title]


PATH = Path("scan.gwy")
FACTS = ScanFacts(2e-6, 1e-6, 0.5, upward=False, overscan=0.0)


def listed(*titles: str, units: Sequence[str] = ()) -> list[Direction]:
    """Return directions whose values are their numbers in the list."""
    every = [*units, *("m",) * (len(titles) - len(units))]
    return [
        Direction(*split_title(title), unit, FACTS, np.full((8, 9), float(number)))
        for number, (title, unit) in enumerate(zip(titles, every, strict=True))
    ]


CHOICES = [
    (("Amplitude forward", "Z-Axis forward", "Z-Axis backward"), ("Z-Axis", 1, 2)),
    (("Height Sensor trace", "Height trace", "Height retrace"), ("Height", 1, 2)),
    (("ZSensorTrace", "HeightTrace", "HeightRetrace", "ZSensorRetrace"), ("ZSensor", 0, 3)),
    (("Phase", "Topography", "Height"), ("Topography", 1, None)),
    (("Height retrace", "Z trace"), ("Z", 1, None)),
    (("My channel",), ("My channel", 0, None)),
    (("Height trace", "Height trace", "Height retrace"), ("Height", 0, 2)),
]


@pytest.mark.parametrize(("titles", "expected"), CHOICES, ids=str)
def test_the_height_with_both_directions(
    titles: tuple[str, ...], expected: tuple[str, int, int | None]
) -> None:
    image = image_of(PATH, chosen(paired(listed(*titles)), None))
    retrace = None if image.retrace is None else image.retrace[0, 0]
    assert (image.channel, image.trace[0, 0], retrace) == expected


def test_a_title_that_comes_again_is_another_channel() -> None:
    found = paired(listed("Z trace", "Z retrace", "Z retrace", "Z trace", "Z trace"))
    names = {name: sorted(sides) for name, sides in found.items()}
    assert names == {"Z": [False, True], "Z (2)": [False, True], "Z (3)": [False]}
    assert chosen(found, "z (2)")[False].values[0, 0] == 3


def test_a_height_in_another_unit_is_none() -> None:
    found = paired(listed("Height trace", "Phase trace", units=["V", "deg"]))
    with pytest.raises(InputError, match="named as a height in m: give one of 'Height', 'Phase'"):
        chosen(found, None)
    assert chosen(found, "Height")[False].unit == "V"


def test_what_is_stated_of_the_scan() -> None:
    image = image_of(PATH, paired(listed("Height"))["Height"])
    facts = (image.range_x, image.range_y, image.line_time, image.upward, image.overscan)
    assert facts == (2e-6, 1e-6, 0.5, False, 0.0)
    assert (image.name, image.assumptions) == ("scan.gwy", ())


def real(name: str) -> Path:
    package = pytest.importorskip("NSFopen")
    found = [*Path(package.__file__).parent.glob(f"example/*/{name}.nid")]
    if not found:
        pytest.skip(f"the installed NSFopen brings no {name}.nid")
    return found[0]


REAL = {
    "circles": ("Topography", 50e-6, 256, 4.0, True, 0.05),
    "squares_holes": ("Topography", 50e-6, 256, 4.0, True, 0.05),
    "grid": ("Z-Axis", 3e-6, 256, 1.5606, False, 0.0),
    "MoS2": ("Z-Axis", 3.97339e-6, 512, 1.3606, False, 0.1),
}
"""Read in the headers by eye: Dim0Range, Points, twice ScanTime or Time/Line, Overscan."""


@pytest.mark.parametrize("name", REAL)
def test_images_of_nanosurf(name: str) -> None:
    channel, size, pixels, line_time, upward, overscan = REAL[name]
    image = read_image(real(name))
    assert (image.channel, image.pixels, image.upward) == (channel, pixels, upward)
    found = (image.range_x, image.range_y, image.line_time, image.overscan)
    assert found == pytest.approx((size, size, line_time, overscan))
    rotated = "its lines are rotated" in " ".join(image.assumptions)
    assert (len(image.assumptions), rotated) == ((0, False) if name == "MoS2" else (1, True))


@pytest.mark.parametrize("name", ["circles", "squares_holes", "grid"])
def test_trace_and_retrace_of_nanosurf_show_the_same(name: str) -> None:
    image = read_image(real(name))
    assert image.retrace is not None
    assert likeness(image.trace, image.retrace) > 0.85
    assert likeness(image.trace, image.retrace[:, ::-1]) < 0.3


def likeness(one: Array, other: Array) -> float:
    """Largest correlation of images whose lines were levelled, over shifts of a few pixels."""
    inner = slice(12, -12)
    first, second = (levelled(image) for image in (one, other))
    shifted = (np.roll(second, shift, axis=1)[:, inner].ravel() for shift in range(-12, 13))
    return max(float(np.corrcoef(first[:, inner].ravel(), each)[0, 1]) for each in shifted)


def levelled(image: Array) -> Array:
    line = np.vander(np.arange(image.shape[1]), 2)
    return image - (line @ np.linalg.lstsq(line, image.T, rcond=None)[0]).T


def test_another_channel_by_its_name() -> None:
    image = read_image(real("circles"), "amplitude")
    assert (image.channel, image.unit) == ("Amplitude", "V")
    with pytest.raises(InputError, match="no channel 'Phase': give one of 'Topography', 'Ampl"):
        read_image(real("circles"), "Phase")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("spectroscopy", "'Z-Axis' was saved while its row 156 of 256 was scanned"),
        ("thermal", "holds no image, but other data"),
    ],
)
def test_files_of_nanosurf_that_hold_no_whole_image(name: str, says: str) -> None:
    with pytest.raises(InputError, match=re.escape(says)):
        read_image(real(name))


def test_the_image_is_of_the_public_class(tmp_path: Path) -> None:
    assert isinstance(read_image(str(npz(tmp_path / "a.npz"))), ScanImage)
