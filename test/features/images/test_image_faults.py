"""A file that is damaged, cut short or of another kind is one InputError that names it."""

import random
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.features.images.files.channels import image_channels
from afm_scan_ros.features.images.files.formats import FORMATS, read_image, write_image
from afm_scan_ros.features.images.scan_image import ScanImage
from helpers.image_files import STEP, WRITERS, Scan

for needed in ("NSFopen", "pySPM", "igor2", "gwyfile", "gsffile"):
    pytest.importorskip(needed)

RNG = np.random.default_rng(3)
TRACE, RETRACE = STEP * RNG.integers(-3000, 3000, (2, 8, 9))
GOOD = Scan(TRACE, RETRACE, 4e-6, 3e-6, 0.5, upward=True)


def written(path: Path) -> bytes:
    """Content of a good file of the suffix."""
    if path.suffix in WRITERS:
        WRITERS[path.suffix](path, GOOD)
    elif path.suffix == ".npz":
        np.savez(path, trace=TRACE, retrace=RETRACE, range_x=4e-6, range_y=3e-6, unit="m")
    else:
        write_image(path, image_channels(ScanImage(TRACE, RETRACE, 4e-6, 3e-6)))
    return path.read_bytes()


CONTENT = {}
with TemporaryDirectory() as made:
    for each in FORMATS:
        CONTENT[each] = written(Path(made) / f"good{each}")


def refusal(path: Path) -> str:
    """Return why a file is refused."""
    with pytest.raises(InputError) as found:
        read_image(path)
    said = str(found.value)
    assert said.startswith(f"{path}: ")
    assert "\n" not in said
    return said


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_file_cut_short(suffix: str, tmp_path: Path) -> None:
    content, path = CONTENT[suffix], tmp_path / f"cut{suffix}"
    for size in sorted({0, 1, *np.linspace(2, len(content) - 1, 40).astype(int).tolist()}):
        path.write_bytes(content[:size])
        assert refusal(path)


@pytest.mark.parametrize("suffix", FORMATS)
@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32))
def test_a_damaged_file_is_refused_or_read(suffix: str, seed: int) -> None:
    """Whatever a reader runs into, and it never hangs; damaged samples are read as they are."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    content = bytearray(CONTENT[suffix])
    for _ in range(chance.randint(1, 8)):
        content[chance.randrange(min(len(content), 1500))] = chance.randrange(256)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"damaged{suffix}"
        path.write_bytes(content)
        try:
            read_image(path)
        except InputError as error:
            assert str(error).startswith(f"{path}: ")  # noqa: PT017 - it need not be raised


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n" + bytes(500), b"time,drive\n0,1\n"])
def test_a_file_of_another_kind(suffix: str, content: bytes, tmp_path: Path) -> None:
    (tmp_path / f"other{suffix}").write_bytes(content)
    assert refusal(tmp_path / f"other{suffix}")


def test_paths_that_are_no_image(tmp_path: Path) -> None:
    assert "no such file" in refusal(tmp_path / "none.nid")
    (tmp_path / "picture.png").write_bytes(b"")
    assert "no format of images that is known: give .nid, .gwy" in refusal(tmp_path / "picture.png")


ARCHIVES = {
    "no array 'range_x': add it": {"trace": TRACE, "range_y": 1.0},
    "unknown key 'retrase'; did you mean 'retrace'?": {"trace": TRACE, "retrase": TRACE},
    "trace holds complex128: give real numbers": {"trace": 1j * TRACE},
    "range_x has shape (2,): give one number": {"trace": TRACE, "range_x": np.ones(2)},
    "trace (8, 9) and retrace (9, 8) differ": {"trace": TRACE, "retrace": TRACE.T},
    "not a finite number in line 0, pixel 0": {"trace": np.full((8, 8), np.nan)},
    "an image of shape (3, 9)": {"trace": TRACE[:3]},
    "range_x = -1e-06: give a number above 0": {"trace": TRACE, "range_x": -1e-6, "range_y": 1e-6},
}


@pytest.mark.parametrize("says", ARCHIVES)
def test_arrays_that_are_no_image(says: str, tmp_path: Path) -> None:
    ranges = {} if "add it" in says else {"range_x": 1e-6, "range_y": 1e-6}
    np.savez(tmp_path / "a.npz", **(ranges | ARCHIVES[says]))
    assert says in refusal(tmp_path / "a.npz")


def test_a_scan_that_was_stopped(tmp_path: Path) -> None:
    path = tmp_path / "stopped.nid"
    path.write_bytes(CONTENT[".nid"].replace(b"CurLine=7", b"CurLine=5"))
    assert "was saved while its row 5 of 8 was scanned: save a whole image" in refusal(path)


def test_samples_that_the_header_does_not_state(tmp_path: Path) -> None:
    """NSFopen counts from the end of the file, so that all samples would be moved."""
    (tmp_path / "long.nid").write_bytes(CONTENT[".nid"] + b"\0\0")
    assert "states 288 bytes of samples and 290 follow" in refusal(tmp_path / "long.nid")


def test_only_a_retrace(tmp_path: Path) -> None:
    channels = image_channels(ScanImage(TRACE, RETRACE, 4e-6, 3e-6))[1:]
    write_image(tmp_path / "a.gwy", channels)
    said = refusal(tmp_path / "a.gwy")
    assert "holds only the retrace of 'Topography': save its trace as well" in said
