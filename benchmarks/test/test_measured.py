"""Measurements are looked for in AFM_SCAN_DATA."""

from pathlib import Path

import pytest

from afm_scan_bench.measured.recordings import measured_data
from afm_scan_ros.core.errors import InputError


def test_folder_is_the_one_the_variable_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "forc").mkdir()
    monkeypatch.setenv("AFM_SCAN_DATA", str(tmp_path))
    assert measured_data("forc") == tmp_path / "forc"


def test_missing_measurements_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AFM_SCAN_DATA", str(tmp_path))
    with pytest.raises(InputError, match="piezo_fsm: no measurements there: set AFM_SCAN_DATA"):
        measured_data("piezo_fsm")
