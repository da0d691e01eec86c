"""A table as it is printed: what does not fit is wrapped, and no number is cut."""

import pytest

from afm_scan_ros.report.table import Table

COLUMNS = {"what": ("what", ""), "one": ("first, V", ".3f"), "other": ("another one, nm", ".2f")}
ROW = {"what": "hysteresis and vibration", "one": 12345.678, "other": 98765432.1}


@pytest.mark.parametrize("width", [10, 30, 80])
def test_numbers_and_words_stand_whole_at_any_width(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    Table("name", "A title of [several] words", COLUMNS, [ROW]).show()
    printed = capsys.readouterr().out.split()
    assert {"12345.678", "98765432.10", "hysteresis", "vibration", "[several]"} <= set(printed)
