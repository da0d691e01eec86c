"""A model known at one rate alone is told from one known at several."""

import numpy as np
import pytest
from attrs import evolve
from scipy.signal import sawtooth

from afm_scan_ros.core.bands import rms_by_band
from afm_scan_ros.core.diagnosis.diagnosis import Diagnosis, diagnose
from afm_scan_ros.core.diagnosis.observation import Observation
from afm_scan_ros.core.diagnosis.one_rate import one_rate
from afm_scan_ros.core.known_error import KnownError, band_edges
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Array
from afm_scan_ros.files.diagnosis_file import diagnosis_document
from afm_scan_ros.report.diagnosis_words import conclusions
from helpers.in_process import ALL, default_model, scan

PERIOD = 5e-4
TIME = PERIOD * np.arange(20_000)
SPEC = ScanSpec(line_rate=20.0, lines=4, samples_per_line=500, preparation_cycles=5)


def known_of(moved: Array) -> KnownError:
    bands = band_edges(PERIOD)
    size = rms_by_band(moved, bands, PERIOD)
    return KnownError("one", bands, 0.01 * size, 0.0 * size, size)


def triangle(rate: float) -> Array:
    return 1e-5 * np.asarray(sawtooth(2.0 * np.pi * rate * TIME, 0.5))


@pytest.mark.parametrize("rate", [0.5, 2.0, 20.0, 200.0])
def test_loops_of_one_rate_are_of_one(rate: float) -> None:
    known = one_rate([known_of(triangle(rate)), known_of(0.3 * triangle(rate))])
    assert known is not None
    assert known[0] <= rate <= known[1]


def test_loops_of_two_rates_are_of_several() -> None:
    assert one_rate([known_of(triangle(2.0)), known_of(triangle(50.0))]) is None
    assert one_rate([known_of(triangle(2.0) + triangle(50.0))]) is None


def test_what_is_not_known_is_of_no_rate() -> None:
    assert one_rate([]) is None
    assert one_rate([known_of(0.0 * TIME)]) is None


def traced(x: AxisModel) -> Diagnosis:
    done = scan(SPEC, ALL)
    return diagnose(
        evolve(default_model(), x=x), [Observation("scan", done.drive, done.measured, SPEC)]
    )


def test_the_verdict_says_so() -> None:
    """The model that ``identify`` makes is known at many rates, and nothing is said of it."""
    x = default_model().x
    assert one_rate(x.known_errors) is None
    assert x.known_error is not None
    band = (np.array(x.known_error.bands[:-1]) == 10.0).astype(float)
    at_one = evolve(x.known_error, displacement=band * np.array(x.known_error.displacement))
    assert not any("known at" in said for said in conclusions(traced(x)))
    found = traced(evolve(x, known_error=at_one, known_elsewhere=()))
    said = [*conclusions(found)]
    assert diagnosis_document(found)["cautions"] == list(found.cautions)
    assert any(each.startswith("x: the model is known at 10 to 30 Hz alone") for each in said)
    assert not any(each.startswith("y: the model is known") for each in said)
