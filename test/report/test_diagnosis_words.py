"""Shares and alternatives say what they are, where a reader would take them for something else."""

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND
from afm_scan_ros.core.diagnosis.result import MODEL_ERROR, Alternative, IdentifiedEffect
from afm_scan_ros.report.diagnosis_words import alternative_rows, share_words

if TYPE_CHECKING:
    from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis


@pytest.mark.parametrize(
    ("fraction", "said"),
    [
        (0.874, "Its own share is 87.4 %"),
        (
            2.553,
            "Its own share is 255 %, more than there was, for it and the others cancel in part",
        ),
    ],
)
def test_a_share_beyond_all_says_how_it_can_be(fraction: float, said: str) -> None:
    assert share_words(IdentifiedEffect("delay", "", (), "x", (), fraction, ())) == said


def test_what_does_as_well_is_no_runner_up() -> None:
    """One axis may be ambiguous where the other is not."""
    found = SimpleNamespace(
        by_axis={"x": SimpleNamespace(verdict=AMBIGUOUS), "y": SimpleNamespace(verdict=FOUND)},
        alternatives=(
            Alternative(MODEL_ERROR, "", "x", 99.0, "is in step"),
            Alternative("drift", "", "y", 20.0, "leaves more"),
        ),
    )
    diagnosis = cast("Diagnosis", found)
    assert alternative_rows(diagnosis, ambiguous=True) == [
        ("model_error", "x", "99.0", "is in step")
    ]
    assert alternative_rows(diagnosis, ambiguous=False) == [
        ("drift, exponential", "y", "20.0", "leaves more")
    ]
