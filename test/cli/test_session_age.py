"""A session of scans ages its simulated scanner, so that a drift goes on from scan to scan."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from afm_scan_ros.cli import driving
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.trajectory import total_samples
from afm_scan_ros.core.types import Trace
from helpers.in_process import FAST_SPEC, default_model

TOTAL = total_samples(FAST_SPEC)


def test_each_scan_begins_as_old_as_those_before_took(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ages: list[object] = []

    def run_scan(*given: object) -> None:
        ages.append(given[-1]["piezoscanner_sim"]["age_s"])  # type: ignore[index]

    def read_scan(_: Path) -> SimpleNamespace:
        still = np.zeros(TOTAL)
        trace = Trace(0, FAST_SPEC.sample_period, still, still)
        info = info_of_scan(FAST_SPEC, "scan", 0)
        return SimpleNamespace(topics=(), info=info, whole=lambda _: trace)

    monkeypatch.setattr(driving, "run_scan", run_scan)
    monkeypatch.setattr(driving, "read_scan", read_scan)
    made = driving.RecordedSession(driving.DrivenScanner(), tmp_path)
    for label in ("first", "second", "third"):
        made.scan(label, FAST_SPEC, default_model())
    took = TOTAL * FAST_SPEC.sample_period
    assert ages == pytest.approx([0.0, took, 2.0 * took])
