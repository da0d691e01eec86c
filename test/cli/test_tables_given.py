"""Tables whose headings do not state what they hold, given to the commands that read records."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from afm_scan_ros.cli.identify import identify

TIME = np.arange(0.0, 40.0, 0.01)
DRIVE = np.where(TIME < 5.0, 0.0, 2.0)
MOVED = 3.0 * np.where(TIME < 5.0, 0.0, 2.0 * (1.1 - 0.1 * np.exp((5.0 - TIME) / 4.0)))
"""µm, of a scanner with one element of creep."""


def identified(file: Path, *options: str) -> Result:
    out = file.with_suffix(".yaml")
    return CliRunner().invoke(identify, [str(file), *options, "--out", str(out)])


@pytest.fixture
def file(tmp_path: Path) -> Path:
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(TIME))
    path = tmp_path / "own.csv"
    table = np.column_stack([TIME, DRIVE, MOVED + noise])
    np.savetxt(path, table, fmt="%.7g", delimiter=",", header="clock,out,sensor", comments="")
    return path


def test_the_advice_of_a_refusal_works_as_typed(file: Path) -> None:
    refused = identified(file)
    assert refused.exit_code != 0
    message = f"{refused.output}{refused.exception}"
    advice = "--columns time=1:s,drive_x=2:V,achieved_x=3:um"
    assert advice in message
    assert identified(file, *advice.split()).exit_code == 0


@pytest.mark.evidence
def test_units_in_headings_are_enough_and_a_warning_reports_it(
    file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = file.read_text("utf-8").partition("\n")[2]
    file.write_text("Time (s),Voltage (V),Position (um)\n" + rows, "utf-8")
    found = identified(file)
    assert found.exit_code == 0
    assert "drive_x from 'Voltage (V)', achieved_x from 'Position (um)'" in caplog.text
