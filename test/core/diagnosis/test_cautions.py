"""A residual that is not quite at rest is not passed over where nothing could be named."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND, SUFFICIENT, AxisDiagnosis
from afm_scan_ros.core.diagnosis.cautions import cautions
from afm_scan_ros.core.diagnosis.discrepancy import AT_LIMIT
from helpers.in_process import default_model


def traced(verdict: str, **loudest: float) -> AxisDiagnosis:
    """Trace of records by their names, each of two bands, the upper one so loud."""
    evidence = [
        SimpleNamespace(
            playback=SimpleNamespace(view=SimpleNamespace(name=name)),
            floor=SimpleNamespace(edges=(0.0, 10.0, 30.0)),
        )
        for name in loudest
    ]
    after = tuple(np.array([1.0, ratio]) for ratio in loudest.values())
    made: Any = SimpleNamespace(verdict=verdict, evidence=tuple(evidence), ratio_after=after)
    return cast("AxisDiagnosis", made)


def said(trace: AxisDiagnosis) -> str:
    return " ".join(cautions(default_model(), {"x": trace}))


def test_records_that_do_not_share_what_stands_out_are_said_to_differ() -> None:
    words = said(traced(SUFFICIENT, scan=2.4, dither=1.0))
    assert words.startswith("x: scan stands 2.4 times above its floor from 10 to 30 Hz")
    assert "Trace each by itself" in words


def test_of_one_record_it_may_be_chance() -> None:
    assert "may be chance" in said(traced(SUFFICIENT, scan=2.4))


@pytest.mark.parametrize(
    "trace", [traced(SUFFICIENT, scan=0.99 * AT_LIMIT), traced(FOUND, scan=2.4)]
)
def test_nothing_is_said_at_the_floor_or_beside_what_was_found(trace: AxisDiagnosis) -> None:
    assert not said(trace)
