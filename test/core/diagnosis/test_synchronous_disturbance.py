"""A disturbance synchronous with the drive is uncertain; an asynchronous one is certain."""

from collections.abc import Iterator

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis import search as selection
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    UNEXPLAINED,
    repeats,
)
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import Trace
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(line_rate=20.0, lines=8, samples_per_line=500, preparation_cycles=5)
IN_STEP, OUT_OF_STEP = 140.0, 150.0
STILL = 20_000


@pytest.fixture(autouse=True)
def _alone() -> Iterator[None]:
    """Let no other effect be tried."""
    alone = tuple(c for c in selection.CANDIDATES if c.effect.name == "periodic_disturbance")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selection, "CANDIDATES", alone)
        yield


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def with_tone(moved: Trace, frequency: float, size: float = 3e-7) -> Trace:
    time = moved.sample_period * np.arange(len(moved.x))
    return evolve(moved, x=moved.x + size * np.sin(2.0 * np.pi * frequency * time))


def scanned(healthy: Scan, frequency: float) -> Record:
    return Record.of_traces("scan", healthy.drive, with_tone(healthy.measured, frequency), SPEC)


def test_harmonics_of_a_synchronous_disturbance_are_synchronous(healthy: Scan) -> None:
    """At a multiple of the line rate hum, as one effect or a tone each, is no more certain."""
    hum = with_tone(with_tone(healthy.measured, IN_STEP), 2.0 * IN_STEP)
    record = Record.of_traces("scan", healthy.drive, hum, SPEC)
    assert diagnose(default_model(), [record]).verdict in (AMBIGUOUS, UNEXPLAINED)


def test_an_asynchronous_one_is_certain_beside_an_error_that_no_record_tests(healthy: Scan) -> None:
    model = default_model()
    known = tuple(evolve(one, fitted=True) for one in model.x.model_discrepancies)
    fitted = evolve(model, x=evolve(model.x, model_discrepancy=known[0], known_elsewhere=known[1:]))
    found = diagnose(fitted, [scanned(healthy, OUT_OF_STEP)]).by_axis["x"]
    assert found.untested
    assert found.verdict == FOUND


def rested(frequency: float, size: float, period: float = 1e-4) -> Record:
    """Of a scanner that its drive leaves alone."""
    noise = np.random.default_rng(2).normal(0.0, 2e-9, (2, STILL))
    still, moved = Trace(0, period, *np.zeros((2, STILL))), Trace(0, period, *noise)
    return Record.of_traces("rest", still, with_tone(moved, frequency, size), kind="rest")


def traced(*records: Record) -> ScannerDiagnosis:
    found = diagnose(default_model(), records)
    assert {effect.name for effect in found.effects} == {"periodic_disturbance"}
    return found


@pytest.mark.evidence
def test_an_asynchronous_disturbance_is_named(healthy: Scan) -> None:
    assert traced(scanned(healthy, OUT_OF_STEP)).verdict == FOUND


def test_a_synchronous_disturbance_is_uncertain_and_rest_is_proposed(healthy: Scan) -> None:
    found = traced(scanned(healthy, IN_STEP))
    assert (found.verdict, found.experiment) == (AMBIGUOUS, "rest")
    assert found.effects[0].evidence.synchronous
    other, *_ = found.alternatives
    assert (other.name, other.kind_label, other.axis) == ("model_error", "", found.effects[0].axis)


@pytest.mark.evidence
def test_a_record_at_rest_resolves_it(healthy: Scan) -> None:
    seen, unseen = (traced(scanned(healthy, IN_STEP), rested(IN_STEP, s)) for s in (3e-7, 0.0))
    assert (seen.verdict, unseen.verdict) == (FOUND, AMBIGUOUS)
    assert unseen.experiment != "rest"


@pytest.mark.evidence
def test_a_long_record_tells_the_frequency_of_a_tone_in_a_short_one(healthy: Scan) -> None:
    """The scan tells it to a hertz, which is eighty periods of it beside the rest of 40 s."""
    tone = OUT_OF_STEP + 0.31
    found = traced(scanned(healthy, tone), rested(tone, 3e-8, 2e-3))
    assert found.verdict == FOUND
    (effect,) = found.effects
    frequency = next(each for each in effect.values if each.parameter.name == "frequency")
    assert frequency.value == pytest.approx(tone, abs=5e-3)


@pytest.mark.parametrize("rate", [3.0, 20.0, 100.0])
def test_a_divisor_of_a_frequency_is_synchronous_with_it(rate: float) -> None:
    nothing = np.zeros(10_000)
    view = AxisSignals("one", 1e-4, nothing, nothing, nothing, rates=(rate,))
    multiples = rate * np.arange(1, 20)
    for off, said in ((0.0, True), (0.99, True), (1.01, False)):
        assert all(repeats(view, float(m + off)) is said for m in multiples)
    assert not repeats(view, 0.5 * rate)
