"""A model known at one rate alone is told from one known at several."""

import numpy as np
import pytest
from attrs import evolve
from scipy.signal import sawtooth

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.cautions import SingleRate, UntestedMotion, single_rate_band
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.model import AxisModel, ModelDiscrepancy, band_edges
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.diagnosis_json import diagnosis_document
from afm_scan_ros.report.diagnosis_text import limits_text
from helpers.in_process import ALL, default_model, scan

PERIOD = 5e-4
TIME = PERIOD * np.arange(20_000)
SPEC = ScanSpec(line_rate=20.0, lines=4, samples_per_line=500, preparation_cycles=5)


def known_of(moved: Array) -> ModelDiscrepancy:
    bands = band_edges(PERIOD, 450.0)
    size = rms_by_band(moved, bands, PERIOD)
    return ModelDiscrepancy("one", bands, 0.01 * size, 0.0 * size, size)


def triangle(rate: float) -> Array:
    return 1e-5 * np.asarray(sawtooth(2.0 * np.pi * rate * TIME, 0.5))


@pytest.mark.parametrize("rate", [0.5, 2.0, 20.0, 200.0])
def test_loops_of_one_rate_are_of_one(rate: float) -> None:
    known = single_rate_band([known_of(triangle(rate)), known_of(0.3 * triangle(rate))])
    assert known is not None
    assert known[0] <= rate <= known[1]


def test_loops_of_two_rates_are_of_several() -> None:
    assert single_rate_band([known_of(triangle(2.0)), known_of(triangle(50.0))]) is None
    assert single_rate_band([known_of(triangle(2.0) + triangle(50.0))]) is None


def test_what_is_not_known_is_of_no_rate() -> None:
    assert single_rate_band([]) is None
    assert single_rate_band([known_of(0.0 * TIME)]) is None


def traced(x: AxisModel) -> ScannerDiagnosis:
    done = scan(SPEC, ALL)
    return diagnose(
        evolve(default_model(), x=x), [Record.of_traces("scan", done.drive, done.measured, SPEC)]
    )


def test_the_verdict_says_so() -> None:
    """The model that ``identify`` makes is known at many rates, and nothing is said of it."""
    x = default_model().x
    assert single_rate_band(x.model_discrepancies) is None
    assert x.model_discrepancy is not None
    band = (np.array(x.model_discrepancy.bands[:-1]) == 10.0).astype(float)
    at_one = evolve(
        x.model_discrepancy, displacement=band * np.array(x.model_discrepancy.displacement)
    )
    assert not any(isinstance(each, SingleRate) for each in traced(x).cautions)
    found = traced(evolve(x, model_discrepancy=at_one, known_elsewhere=()))
    untested, single = found.cautions
    assert isinstance(untested, UntestedMotion)
    assert single == SingleRate("x", 10.0, 30.0)
    *_, text = diagnosis_document(found)["cautions"]
    assert "10 to 30 Hz alone" in text
    assert text in limits_text(found)
