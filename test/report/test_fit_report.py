"""The fit report states of each effect what was fitted on what, how well, and what to beware of."""

import json

import numpy as np
import pytest
from attrs import evolve
from markupsafe import escape

from afm_scan_ros.core.identification.alternating import Sizes
from afm_scan_ros.core.identification.drives.excitation import Plan, hysteresis_plan
from afm_scan_ros.core.identification.drives.waveforms import Waypoints
from afm_scan_ros.core.identification.findings import UndeterminedCreepElement
from afm_scan_ros.core.identification.identify import (
    Identification,
    identify_records,
)
from afm_scan_ros.report.fit_page import fit_page
from afm_scan_ros.report.fit_summary import finding_text, fit_summary
from helpers.in_process import default_plant, record
from helpers.small_records import frequency

pytestmark = pytest.mark.evidence


def short_creep() -> Plan[Waypoints]:
    """Holds of 300 and 60 s, which cannot identify y's element of 1700 s."""
    samples = 100.0 * np.array([0.0, 2.0, 2.1, 302.1, 302.2, 362.2, 364.0])
    steps = Waypoints(0.01, np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 0.0]), samples, 5.0)
    return Plan("creep", steps, steps)


@pytest.fixture(scope="module")
def found() -> Identification:
    plans = short_creep(), frequency(), hysteresis_plan(levels=7)
    made = [evolve(record(plan, default_plant(), seed=1), kind=plan.name) for plan in plans]
    return identify_records(made, Sizes(levels=13))


@pytest.fixture(scope="module")
def page(found: Identification) -> str:
    return fit_page(found)


def test_numbers_are_json_and_open_intervals_null(found: Identification) -> None:
    summary = json.loads(json.dumps(fit_summary(found), allow_nan=False))
    for axis in ("x", "y"):
        effects = summary[axis]
        assert all(effects[name]["record"] for name in ("creep", "vibration", "hysteresis"))
        low, high = effects["vibration"]["resonance_interval_hz"]
        assert low < effects["vibration"]["resonance_hz"] < high
        assert effects["creep"]["held_out"]["sigma_m"] > 0.0
        assert effects["hysteresis"]["exact_inverse_held_out"]["samples"] > 1000
        assert effects["model_discrepancy"]["record"].startswith("hysteresis, the loops after")


def test_what_intervals_span_and_what_they_leave_out_is_reported(
    found: Identification, page: str
) -> None:
    summary = fit_summary(found)
    for axis in ("x", "y"):
        vibration = summary[axis]["vibration"]
        low, high = vibration["gain_interval"]
        others = vibration["intervals_span"]
        orders, levels = (
            sorted(n for n in others if ("poles" in n) is has) for has in (True, False)
        )
        assert (len(orders), len(levels)) == (2, 1)
        assert f"{orders[0]}, {levels[0]}" == orders[1]
        assert all(low < other["gain_over_reference"] < high for other in others.values())
        assert all(f"{axis}, {name}" in page for name in others)
    assert "minor loops that are not congruent" in page


def test_amplitude_and_delay_have_their_place(found: Identification, page: str) -> None:
    """Three waves of one strength do not identify zero amplitude; the record is in time."""
    vibration = fit_summary(found)["x"]["vibration"]
    assert vibration["at_zero_amplitude"] is None
    assert "one amplitude only" in page
    assert vibration["delay"]["determined"]
    assert abs(vibration["delay"]["found_s"]) < 1e-5  # a tenth of a sample
    assert vibration["delay"]["of_the_model_s"] == 0.0


def test_the_findings_on_a_short_record_are_shown(found: Identification, page: str) -> None:
    warnings = found.axes["y"].report.warnings
    assert any(isinstance(each, UndeterminedCreepElement) for each in warnings)
    assert all(
        f'<p class="warning">y: {escape(finding_text(each))}</p>' in page for each in warnings
    )
    assert fit_summary(found)["y"]["warnings"] == [finding_text(each) for each in warnings]


def test_the_page_is_whole_and_needs_nothing_else(found: Identification, page: str) -> None:
    for heading in ("Creep", "Vibration", "Hysteresis", "Model discrepancy"):
        assert f"<h2>{heading}</h2>" in page
    assert page.count("data:image/png;base64,") == 5
    assert 'src="http' not in page
    assert f"{found.axes['x'].report.vibration.resonance:.7g} (" in page
