"""Sentences on a residual describe it."""

import re
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.likelihood import Likelihood
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import InitialState
from afm_scan_ros.core.diagnosis.residual_report import describe
from afm_scan_ros.core.diagnosis.search import Posterior, Selection
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.paper import paper_figure
from afm_scan_ros.report.residual import (
    chosen_text,
    initial_state_text,
    residual_pictures,
    residual_text,
)
from helpers.in_process import ALL, default_model, scan
from helpers.posteriors import no_effect

SPEC = ScanSpec(lines=4, samples_per_line=2000)


@pytest.fixture(scope="module")
def healthy() -> Record:
    done = scan(SPEC, ALL)
    return Record.of_traces("scan", done.drive, done.measured, SPEC)


def messages_of(healthy: Record, error: Array) -> str:
    """Words on x, of which the sensor shows something in addition."""
    wrong = healthy.displacement + np.outer(error, [1.0, 0.0])
    observed = evolve(healthy, displacement=wrong)
    evidence = evidence_of("x", default_model(), observed)
    described = describe(evidence, chain_of(default_model().x), observed)
    return " ".join(residual_text(described, evidence.limit))


def trace_of(records: Sequence[Record]) -> AxisDiagnosis:
    """Axis x of several records, with nothing kept."""
    evidence = tuple(evidence_of("x", default_model(), each, i) for i, each in enumerate(records))
    chain = chain_of(default_model().x)
    without = no_effect(Likelihood(evidence, chain).fit(chain))
    none = Selection(without, (), Posterior.of(without, ()))
    return AxisDiagnosis("x", evidence, chain, chain, chain, none, ())


def seconds(healthy: Record) -> Array:
    return np.arange(len(healthy.drive)) * healthy.sample_period


def test_a_disturbance_is_a_line(healthy: Record) -> None:
    message = messages_of(healthy, 2e-7 * np.sin(2.0 * np.pi * 47.0 * seconds(healthy)))
    size = re.search(r"whole record: (46.9.?|47.*?) Hz \((\d+) nm rms\)", message)
    assert size is not None, message
    assert float(size[2]) == pytest.approx(200.0 / np.sqrt(2.0), rel=0.05)
    assert "largest band is 30 to 99.9 Hz" in message


def test_a_line_that_comes_and_goes_is_no_larger_than_the_residual(healthy: Record) -> None:
    """A window would give 200 nm for what is there for a quarter of the record."""
    time = seconds(healthy)
    there = np.abs(time - time.mean()) < time[-1] / 8.0
    message = messages_of(healthy, 2e-7 * there * np.sin(2.0 * np.pi * 470.0 * time))
    rms = re.match(r"([\d.]+) nm rms", message)
    lines = re.findall(r"[\d.]+ Hz \(([\d.]+) nm rms\)", message)
    assert rms is not None
    assert lines
    assert 60.0 < float(lines[0]) <= float(rms[1])


def test_two_adjacent_lines_are_no_more_than_the_residual(healthy: Record) -> None:
    time = seconds(healthy)
    apart = 3.0 / time[-1]
    pair = (np.sin(2.0 * np.pi * rate * time) for rate in (470.0, 470.0 + apart))
    message = messages_of(healthy, 2e-7 * sum(pair))
    rms = re.match(r"([\d.]+) nm rms", message)
    sizes = [float(size) for size in re.findall(r"47\d[\d.]* Hz \(([\d.]+) nm rms\)", message)]
    assert rms is not None
    assert sizes == pytest.approx([141.0, 141.0], rel=0.1)
    assert np.linalg.norm(sizes) <= 1.01 * float(rms[1])


def test_of_several_records_it_says_which_is_described(healthy: Record) -> None:
    wrong = healthy.displacement + np.outer(1e-6 * seconds(healthy), [1.0, 0.0])
    records = healthy, evolve(healthy, name="late", displacement=wrong)
    trace = trace_of(records)
    message = chosen_text(trace)
    assert message.startswith("This is late, ")
    assert "in scan" in message
    assert not chosen_text(trace_of(records[:1]))


def test_drift_moves_whole_lines(healthy: Record) -> None:
    message = messages_of(healthy, 1e-6 * seconds(healthy))
    assert "one quantity alone explains: time (100%)" in message
    assert "preparation of a scan differs from its lines" in message


def test_a_lag_is_a_matter_of_direction_and_speed(healthy: Record) -> None:
    message = messages_of(
        healthy, -1e-4 * np.gradient(healthy.signals("x")[1], healthy.sample_period)
    )
    assert "it depends on direction" in message
    assert "one quantity alone explains: speed" in message


def test_a_bent_sensor_is_a_matter_of_place(healthy: Record) -> None:
    message = messages_of(healthy, 1e3 * healthy.signals("x")[1] ** 2)
    assert "it depends on position." in message
    assert "one quantity alone explains: position" in message


def test_what_is_not_white_may_yet_be_at_the_floor(healthy: Record) -> None:
    message = messages_of(healthy, np.zeros(len(healthy.drive)))
    outside = re.search(r"(\d+)% of its autocorrelation", message)
    assert outside is not None
    assert int(outside[1]) > 50
    assert "model discrepancy is not white noise" in message


def test_records_that_are_no_scans_are_drawn_too(healthy: Record) -> None:
    evidence = evidence_of("x", default_model(), healthy)
    described = describe(evidence, chain_of(default_model().x), evolve(healthy, scan=None))
    assert described.sides is None
    assert "preparation" not in " ".join(residual_text(described, evidence.limit))
    pictures = residual_pictures("x", evidence.limit, described, described)
    panels = [panel for picture in pictures for panel in picture.panels]
    labels = {panel.x for panel in panels}
    assert "travel since the last turning point in µm" in labels
    assert len(panels) == len(labels) == 7
    for picture in pictures:
        drawn = paper_figure(picture).axes
        assert [axes.get_xlabel() for axes in drawn] == [panel.x for panel in picture.panels]


LIMITS = (-4.0, 4.0)


@pytest.mark.parametrize(
    ("initial_state", "parts"),
    [
        (InitialState(), ("depolarised",)),
        (InitialState((), 0.5), ("depolarised", "at rest at 0.5 V")),
        (InitialState((4.0,), 0.0), ("saturated at its upper end",)),
        (InitialState((1.0, -4.0), 0.0), ("saturated at its lower end",)),
        (InitialState((3.0, -2.0), 0.5), ("3 V and then -2 V", "at rest at 0.5 V")),
    ],
)
def test_the_initial_state_is_reported(initial_state: InitialState, parts: tuple[str, ...]) -> None:
    one: Any = SimpleNamespace(initial_state=initial_state, drive_limits=LIMITS)
    assert all(part in initial_state_text(one) for part in parts)
