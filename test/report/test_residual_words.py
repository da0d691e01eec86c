"""Sentences on a residual say what it is."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.bench.scans import ALL, default_model, scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.tracing.describe import describe
from afm_scan_ros.core.tracing.gathering import gathered
from afm_scan_ros.core.tracing.observation import Observation
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.residual_figures import residual_figure
from afm_scan_ros.report.residual_words import residual_words

SPEC = ScanSpec(lines=4, samples_per_line=2000)


@pytest.fixture(scope="module")
def healthy() -> Observation:
    done = scan(SPEC, ALL)
    return Observation("scan", done.drive, done.measured, SPEC)


def said_of(healthy: Observation, error: Array) -> str:
    """Words on x, of which the sensor shows something in addition."""
    wrong = evolve(healthy.displacement, x=healthy.displacement.x + error)
    observed = evolve(healthy, displacement=wrong)
    evidence = gathered("x", default_model(), observed)
    described = describe(evidence, chain_of(default_model().x), observed)
    return " ".join(residual_words(described, evidence.floor))


def seconds(healthy: Observation) -> Array:
    return np.arange(len(healthy.drive.x)) * healthy.sample_period


def test_a_disturbance_is_a_line(healthy: Observation) -> None:
    said = said_of(healthy, 2e-7 * np.sin(2.0 * np.pi * 47.0 * seconds(healthy)))
    assert "Lines stand out at 46.9" in said or "Lines stand out at 47" in said
    assert "loudest from 30 to 100 Hz" in said


def test_drift_moves_whole_lines(healthy: Observation) -> None:
    said = said_of(healthy, 1e-6 * seconds(healthy))
    assert "goes with one quantity alone: time (100%)" in said


def test_a_lag_is_a_matter_of_direction_and_speed(healthy: Observation) -> None:
    said = said_of(healthy, -1e-4 * np.gradient(healthy.displacement.x, healthy.sample_period))
    assert "a matter of direction" in said
    assert "goes with one quantity alone: speed" in said


def test_a_bent_sensor_is_a_matter_of_place(healthy: Observation) -> None:
    said = said_of(healthy, 1e3 * healthy.displacement.x**2)
    assert "a matter of place:" in said or "a matter of place." in said
    assert "goes with one quantity alone: position" in said


def test_records_that_are_no_scans_are_drawn_too(healthy: Observation) -> None:
    evidence = gathered("x", default_model(), healthy)
    described = describe(evidence, chain_of(default_model().x), evolve(healthy, spec=None))
    assert described.sides is None
    figure = residual_figure(evidence.floor, described, described)
    labels = {panel.get_xlabel() for panel in figure.axes}
    assert "way since the last turn in µm" in labels
    assert len(figure.axes) == len(labels) == 6
