"""The fit report states of each axis what was fitted, how well, and what to beware of."""

import json
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from markupsafe import escape

from afm_scan_ros.core.identification.findings import UncertainScan
from afm_scan_ros.core.identification.identify import Identification, identify_records
from afm_scan_ros.report.fit_page import finding_text, fit_picture, fit_report, fit_summary
from afm_scan_ros.report.picture import Curve
from helpers.fit_cases import FREQUENCY, GAIN, OPERATORS, levels, record


@pytest.fixture(scope="module")
def found() -> Identification:
    fitted = record(OPERATORS["plays"], levels(1, 14, 600))
    held_out = evolve(
        record(OPERATORS["plays"], levels(2, 8, 500)), name="check", kind="validation"
    )
    return identify_records([fitted, held_out])


@pytest.fixture(scope="module")
def page(found: Identification) -> str:
    return fit_report(found, Path("model.yaml")).page()


def test_figures_of_merit_are_those_of_the_residuals(found: Identification) -> None:
    summary = json.loads(json.dumps(fit_summary(found), allow_nan=False))
    (axis,) = found.axes.values()
    for name, residual in (
        ("records", axis.records[0].left),
        ("held_out", axis.validations[0].residual),
    ):
        (figures,) = summary["x"][name].values()
        assert figures["sigma_m"] == pytest.approx(np.std(residual), rel=0.01)
        assert figures["max_m"] == np.abs(residual).max()
        assert figures["samples"] == len(residual)
    assert 0.0 < summary["x"]["direct_inverse"]["sigma_v"] < 0.05
    assert summary["x"]["effects"]["hysteresis"]["status"] == "identified"
    assert summary["x"]["model_discrepancy"][0]["record"].startswith("check:")


def test_the_response_drawn_is_the_scanner_s(found: Identification) -> None:
    drawn = fit_picture(found, "response").panels[0].marks
    lines = {line.name: line for line in drawn if isinstance(line, Curve)}
    assert set(lines) == {"levels", "model"}
    frequency, size = (np.asarray(v) for v in (lines["model"].x, lines["model"].y))
    assert frequency[np.argmax(size)] == pytest.approx(FREQUENCY, rel=0.03)
    measured_at, measured = (np.asarray(v) for v in (lines["levels"].x, lines["levels"].y))
    near = (measured_at > 20.0) & (measured_at < 0.8 * FREQUENCY)
    expected = np.interp(measured_at[near], frequency, size)
    np.testing.assert_allclose(measured[near], expected, rtol=0.1)
    assert measured.min() > 0.0
    assert size.max() > GAIN * 1e6


def test_the_page_is_whole_and_needs_nothing_else(found: Identification, page: str) -> None:
    for heading in ("What is known of each effect", "Creep and hysteresis", "Model discrepancy"):
        assert f"<summary>{heading}</summary>" in page
    assert page.count("<figure>") == 3
    assert "check, held out" in page
    assert f"{found.axes['x'].records[0].misfit.samples:,}" in page


def test_warnings_are_shown(found: Identification) -> None:
    axis = evolve(found.axes["x"], warnings=(UncertainScan(0.034),))
    warned = Identification({"x": axis})
    text = finding_text(UncertainScan(0.034))
    assert (
        f'<p class="warning">x: {escape(text)}</p>' in fit_report(warned, Path("model.yaml")).page()
    )
    assert fit_summary(warned)["x"]["warnings"] == [text]
