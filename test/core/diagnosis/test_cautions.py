"""A residual above its detection limit is stated even where no effect is identified."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND, SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.cautions import AboveDetectionLimit, Caution, cautions
from afm_scan_ros.report.diagnosis_text import caution_text
from helpers.in_process import default_model


def traced(verdict: str, **loudest: float) -> AxisDiagnosis:
    """Trace of records by their names, each of two bands, the upper one so loud."""
    evidence = [
        SimpleNamespace(
            untested=None,
            playback=SimpleNamespace(view=SimpleNamespace(name=name)),
            limit=SimpleNamespace(edges=(0.0, 10.0, 30.0)),
        )
        for name in loudest
    ]
    after = tuple(np.array([1.0, ratio]) for ratio in loudest.values())
    made: Any = SimpleNamespace(verdict=verdict, evidence=tuple(evidence), ratio_after=after)
    return cast("AxisDiagnosis", made)


def found_in(trace: AxisDiagnosis) -> list[Caution]:
    return list(cautions(default_model(), {"x": trace}))


@pytest.mark.parametrize(
    ("records", "others", "reason"),
    [
        ({"scan": 2.4, "dither": 1.0}, True, "Diagnose each record by itself"),
        ({"scan": 2.4}, False, "may be chance"),
    ],
)
def test_the_record_above_its_limit_is_stated(
    records: dict[str, float],
    others: bool,  # noqa: FBT001 - a parameter
    reason: str,
) -> None:
    (found,) = found_in(traced(SUFFICIENT, **records))
    assert found == AboveDetectionLimit("x", "scan", 2.4, 10.0, 30.0, others)
    text = caution_text(found)
    assert "scan is 2.4 times its detection limit from 10 to 30 Hz" in text
    assert reason in text


@pytest.mark.parametrize("trace", [traced(SUFFICIENT, scan=1.6), traced(FOUND, scan=2.4)])
def test_nothing_is_stated_at_the_limit_or_beside_an_effect(trace: AxisDiagnosis) -> None:
    assert not found_in(trace)
