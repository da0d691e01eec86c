"""The paper's results made anew: its statements on its figures hold of ours."""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from afm_scan_bench.commands.reproduce import SECTIONS, reproduce
from afm_scan_bench.paper import figure_6, figure_8, figure_9, figure_10, figure_11, figure_12
from afm_scan_bench.paper.scanner import paper_path, paper_spec

LINES = 48


def test_the_scan_begins_at_rest_at_zero() -> None:
    path = paper_path(paper_spec(30.0, 16), rest=100)
    assert np.all(path.x[:100] == 0.0)
    assert np.all(path.y[:100] == 0.0)
    assert path.x.min() == 0.0
    assert path.x.max() == pytest.approx(40e-6)


def test_figure_9_shows_what_each_inverse_does() -> None:
    found = figure_9.section(LINES).numbers
    none, creep, hysteresis, every = (found[name] for name in figure_9.CASES)
    assert (none["bars_in_view"], every["bars_in_view"]) == (4, 3)
    assert every["pitch_m"] == pytest.approx(16e-6, rel=0.005)
    assert none["pitch_m"] < hysteresis["pitch_m"] < every["pitch_m"]
    assert none["shift_m"] > 4e-6
    assert creep["shift_m"] > 4e-6
    assert hysteresis["shift_m"] < 0.4 * none["shift_m"]
    assert abs(every["shift_m"]) < 0.1e-6
    assert every["bow_m"] < 0.1e-6 < 0.1 * hysteresis["bow_m"]


def test_figure_10_shows_ripples_of_the_first_resonance() -> None:
    found = figure_10.section(LINES).numbers
    rippled, smooth = found["(c) 30 Hz, none"], found["(d) 30 Hz, all"]
    assert rippled["strongest_ripple"]["frequency_hz"] == pytest.approx(454.0, abs=5.0)
    amplitudes = [each["ripple_at_resonance"]["amplitude_m"] for each in (rippled, smooth)]
    assert amplitudes[0] > 50.0 * amplitudes[1]
    assert found["(f) 100 Hz, all"]["pitch_m"] == pytest.approx(16e-6, rel=0.01)


def test_figure_11_keeps_the_grating_and_loses_some_range() -> None:
    section = figure_11.section(LINES)
    lost = next(row.ours for row in section.compared if "lost" in row.quantity)
    assert 0.5 < lost < 20.0
    assert section.numbers["(b) all"]["pitch_m"] == pytest.approx(16e-6, rel=0.02)


def test_figure_12_agrees_with_the_image() -> None:
    path = figure_12.section().numbers
    image = figure_10.section(LINES).numbers["(c) 30 Hz, none"]["ripple_at_resonance"]
    assert path["none"]["ripple_m"] == pytest.approx(image["amplitude_m"], rel=0.05)
    for key in ("second_start_m", "ripple_m", "drift_m"):
        assert abs(path["all"][key]) < 0.05 * abs(path["none"][key])


def test_figures_6_and_8_come_closer_than_the_paper() -> None:
    for section in (figure_6.section(), figure_8.section()):
        for row in section.compared:
            assert row.ours < 0.5 * float(row.published), row.quantity


def test_the_command_writes_report_numbers_and_figures(tmp_path: Path) -> None:
    arguments = ["figure_9", "figure_12", "--lines", "16", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(reproduce, arguments, catch_exceptions=False)
    assert done.exit_code == 0
    document = json.loads((tmp_path / "out/reproduce.json").read_text("utf-8"))
    assert list(document) == ["figure_9", "figure_12"]
    for row in document["figure_9"]["compared"]:
        assert {"quantity", "published", "ours", "unit"} == set(row)
    report = (tmp_path / "out/report.html").read_text("utf-8")
    assert report.count("<img") == 3
    assert "NaN" not in json.dumps(document)
    assert (tmp_path / "out/figure_9_images.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", SECTIONS)
def test_every_section_is_there(name: str) -> None:
    module = __import__(f"afm_scan_bench.paper.{name}", fromlist=["section"])
    assert callable(module.section)
