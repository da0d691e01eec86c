"""A drive that was saved is read as it was; what is none is refused by name."""

from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.files.drive_files import read_drive, save_drive, write_drives

DRIVE = np.random.default_rng(1).standard_normal((50, 2))
PLAN = Plan("steps", 1e-4, DRIVE[:, 0], DRIVE[:, 1])


def test_a_drive_is_read_to_the_bit(tmp_path: Path) -> None:
    (exported,) = write_drives(tmp_path, [PLAN])
    first = read_drive(exported.with_suffix(".npz"))
    for found in (first, read_drive(save_drive(tmp_path, PLAN))):
        assert (found.name, found.sample_period) == ("steps", 1e-4)
        np.testing.assert_array_equal(np.column_stack([found.x, found.y]), DRIVE)


@pytest.mark.parametrize(
    ("drive", "period", "said"),
    [
        (DRIVE[:, :1], 1e-4, r"drive_v of shape \(50, 1\): give finite numbers"),
        (DRIVE[0], 1e-4, r"drive_v of shape \(2,\)"),
        (np.full((5, 2), np.nan), 1e-4, r"drive_v of shape \(5, 2\): give finite numbers"),
        (DRIVE, 0.0, "sample_period_s: give one positive number"),
        (DRIVE, np.inf, "sample_period_s: give one positive number"),
        (DRIVE, [1e-4, 1e-4], "sample_period_s: give one positive number"),
    ],
)
def test_what_is_no_drive_is_refused(
    tmp_path: Path, drive: np.ndarray, period: object, said: str
) -> None:
    path = tmp_path / "steps.npz"
    np.savez(path, drive_v=drive, sample_period_s=np.array(period))
    with pytest.raises(InputError, match=f"^{path}: {said}"):
        read_drive(path)


@pytest.mark.parametrize("content", [b"", b"PK", b"text"])
def test_a_file_that_is_no_archive_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "steps.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"no drive: .*give an .npz file with drive_v"):
        read_drive(path)
    with pytest.raises(InputError, match=r"nowhere.npz: no drive: "):
        read_drive(tmp_path / "nowhere.npz")
