"""What 'afm-scan identify' makes of three records of the simulated scanner."""

from pathlib import Path
from typing import Any

import click
import pytest

from afm_scan_ros.cli.identify import identify
from afm_scan_ros.cli.recorded import diagnose
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files import share_directory

MODEL = share_directory() / "config/model.yaml"


@pytest.mark.parametrize("command", [identify, diagnose])
def test_records_are_taken_to_begin_depolarised_where_that_is_stated(
    command: click.Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The value that reaches the Python interface, which other tests show to matter."""
    seen: list[str] = []

    def note(*given: Any, **_: Any) -> None:  # noqa: ANN401 - records stand at another place in each
        records = next(each for each in given if isinstance(each, list))
        seen.extend(record.start for record in records)
        raise InputError("seen")

    table = tmp_path / "scan.csv"
    table.write_text("time [s],drive_x [V],achieved_x [um]\n0,0,0\n1,1,5\n2,0,0\n", "utf-8")
    monkeypatch.setattr("afm_scan_ros.identification.identify", note)
    monkeypatch.setattr("afm_scan_ros.diagnosis.diagnose", note)
    model = ["--model", str(MODEL)] if command is diagnose else []
    for option in ([], ["--depolarised"]):
        arguments = [str(table), *model, *option, "--out", str(tmp_path / "out")]
        with pytest.raises(InputError, match="seen"):
            command.main(arguments, standalone_mode=False)
    assert seen == ["unknown", "depolarised"]
