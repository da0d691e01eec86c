"""Tasks at the same time: each has its own result, and an error is not lost."""

from threading import Barrier

import pytest

from afm_scan_ros.core.diagnosis.diagnosis import in_parallel
from afm_scan_ros.core.errors import InputError


def test_all_run_at_once_and_each_has_its_result() -> None:
    both = Barrier(2, timeout=20.0)

    def task(name: str) -> str:
        both.wait()
        return name.upper()

    assert in_parallel(task, "xy") == {"x": "X", "y": "Y"}


def test_an_error_of_either_is_raised() -> None:
    def task(name: str) -> str:
        if name == "y":
            raise InputError("no model_discrepancy")
        return name

    with pytest.raises(InputError, match="no model_discrepancy"):
        in_parallel(task, "xy")
