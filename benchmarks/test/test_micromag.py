"""What a MicroMag file holds, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from afm_scan_bench.measured.micromag import read_micromag
from afm_scan_ros.core.errors import InputError

HEADING = """MicroMag 2900/3900 Data File (Series 0015)
First-order reversal curves
Units of measure:  cgs
01/22/2015  17:35

Averaging time = +2.000000E+00
NCrv           = 2

"""
DATA = """+6.8E+03,+1.28E-03

+1.0E+02,+1.20E-03
+1.3E+02,+1.21E-03

+6.8E+03,+1.27E-03

+5.0E+01,+1.10E-03
+9.0E+01,+1.15E-03
+1.3E+02,+1.19E-03

MicroMag 2900/3900 Data File ends
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "curves"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    return path


def test_curves_and_drift_points_are_distinguished(tmp_path: Path) -> None:
    record = read_micromag(write(tmp_path, HEADING + DATA))
    np.testing.assert_array_equal(record.drift, [[6800.0, 1.28e-3], [6800.0, 1.27e-3]])
    first, second = record.curves
    np.testing.assert_array_equal(first.inputs, [100.0, 130.0])
    np.testing.assert_array_equal(second.outputs, [1.10e-3, 1.15e-3, 1.19e-3])
    assert second.inputs[0] == 50.0


@pytest.mark.parametrize(
    ("old", "new", "pattern"),
    [
        ("MicroMag 2900/3900 Data File (", "MyMag (", "line 1 does not begin with 'MicroMag'"),
        ("MicroMag 2900/3900 Data File ends\n", "", "cut short"),
        ("NCrv           = 2", "NCrv           = 3", "line 7 promises 3 curves, the file holds 2"),
        ("+9.0E+01,+1.15E-03", "+9.0E+01,+1.15E--3", "line 17: '.9.0E.01,.1.15E--3' is not"),
        ("+9.0E+01,+1.15E-03", "+9.0E+01", "line 17: "),
        ("+9.0E+01,+1.15E-03", "+9.0E+01,+1.15E-03,+3.0E+02", "line 17: "),
        ("+1.3E+02,+1.21E-03", "+1.3E+02,+1.0E+999", "line 12: "),
        ("+6.8E+03,+1.27E-03\n\n", "", "holds 1"),
        ("+6.8E+03,+1.28E-03\n\n", "+6.8E+03,+1.28E-03\n+6.8E+03,+1.28E-03\n\n", "line 9: a curve"),
        ("+1.3E+02,+1.21E-03", "+0.9E+02,+1.21E-03", "line 11: a curve whose field does not rise"),
    ],
)
def test_broken_files_are_refused_by_line(tmp_path: Path, old: str, new: str, pattern: str) -> None:
    assert old in HEADING + DATA
    path = write(tmp_path, (HEADING + DATA).replace(old, new, 1))
    with pytest.raises(InputError, match=pattern):
        read_micromag(path)


def test_empty_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="line 1"):
        read_micromag(write(tmp_path, ""))
    with pytest.raises(InputError, match="no such file"):
        read_micromag(tmp_path / "none")
