"""Tasks at the same time: each has its own result, and an error is not lost."""

from threading import Barrier

import pytest

from afm_scan_ros.core.diagnosis.side_by_side import side_by_side
from afm_scan_ros.core.errors import InputError


def test_all_run_at_once_and_each_has_its_result() -> None:
    both = Barrier(2, timeout=20.0)

    def task(name: str) -> str:
        both.wait()
        return name.upper()

    assert side_by_side(task, "xy") == {"x": "X", "y": "Y"}


def test_an_error_of_either_is_raised() -> None:
    def task(name: str) -> str:
        if name == "y":
            raise InputError("no known_error")
        return name

    with pytest.raises(InputError, match="no known_error"):
        side_by_side(task, "xy")
