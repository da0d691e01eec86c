"""Order and delay are taken from the record where that is asked for, and reported."""

from html import unescape

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.identification.alternating import Sizes
from afm_scan_ros.core.identification.drives.excitation import hysteresis_plan
from afm_scan_ros.core.identification.findings import UnmodelledDelay
from afm_scan_ros.core.identification.identify import (
    REQUIRED,
    Identification,
    identify_records,
)
from afm_scan_ros.core.record import Record
from afm_scan_ros.report.fit_page import fit_page
from afm_scan_ros.report.fit_summary import VIBRATION_ORDER, fit_summary
from helpers.in_process import default_plant, record
from helpers.small_records import creep, frequency

pytestmark = pytest.mark.evidence

LATE = 4  # samples of 0.1 ms


def late(made: Record) -> Record:
    """The displacement, each sample some samples too late."""
    moved = made.displacement
    return evolve(
        made, displacement=np.concatenate([moved[:1].repeat(LATE, axis=0), moved[:-LATE]])
    )


@pytest.fixture(scope="module")
def found() -> Identification:
    plans = creep(), frequency(), hysteresis_plan(levels=13)
    slow, waves, loops = (record(plan, default_plant(), seed=1) for plan in plans)
    records = [made.axis("x") for made in (slow, late(waves), loops)]
    given = [evolve(made, kind=kind) for made, kind in zip(records, REQUIRED, strict=True)]
    return identify_records(given, Sizes(13, None, delay=True))


def test_the_delay_is_the_model_s_own_where_that_is_asked_for(found: Identification) -> None:
    assert found.axes["x"].model.vibration.delay == pytest.approx(4e-4, abs=1e-5)
    assert not any(isinstance(each, UnmodelledDelay) for each in found.axes["x"].report.warnings)


def test_the_order_is_one_of_those_tried(found: Identification) -> None:
    vibration = fit_summary(found)["x"]["vibration"]
    tried = vibration["orders_tried"]["relative_error_rms"]
    assert len(tried) > 1
    assert vibration["order"] in tried
    page = fit_page(found)
    assert f"{vibration['order']}, chosen" in page
    assert VIBRATION_ORDER in unescape(page)
