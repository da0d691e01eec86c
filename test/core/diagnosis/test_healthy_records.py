"""What healthy records and a fit tell of a model's error, and what a verdict says without them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, sawtooth

import afm_scan_ros as afm
from afm_scan_ros.core.diagnosis.cautions import UntestedMotion
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.diagnosis_text import caution_text

PERIOD = 5e-5


def slipped(drive: Array, width: float) -> Array:
    place, places = 0.0, np.empty_like(drive)
    for k, volts in enumerate(drive):
        place = max(volts - width, min(volts + width, place))
        places[k] = place
    return places


def moved(drive: Array) -> Array:
    """Displacement (m) of slip elements, a resonance at 400 Hz and creep: no Preisach table."""
    slip = np.mean([slipped(drive, width) for width in (0.2, 0.5, 1.0, 2.0)], axis=0)
    speed = 2.0 * np.pi * 400.0
    above, below, _ = cont2discrete(([speed**2], [1.0, 0.04 * speed, speed**2]), PERIOD)
    rigid = 5e-6 * lfilter(above.ravel(), below, 0.8 * drive + 0.2 * slip)
    kept = np.exp(-PERIOD / 0.3)
    return np.asarray(rigid + lfilter([0.0, 0.02 * (1.0 - kept)], [1.0, -kept], rigid))


def record(rate: float, volts: float, seed: int, *, gain: float = 1.0) -> afm.Record:
    """Triangles of some cycles from rest on, with 2 nm of noise."""
    time = np.arange(0.0, max(10.0 / rate, 1.0), PERIOD)
    wave = sawtooth(2.0 * np.pi * rate * time + np.pi / 2.0, 0.5)
    drive = volts * np.minimum(1.0, time * rate) * wave
    measured = gain * moved(drive) + np.random.default_rng(seed).normal(0.0, 2e-9, len(time))
    return afm.Record(drive, measured, PERIOD, name=f"{rate:g} Hz, {volts:g} V, {seed}")


@pytest.fixture(scope="module")
def model() -> afm.Model:
    return afm.identify([record(5.0, 4.0, 1), record(20.0, 2.0, 2)])


@pytest.mark.evidence
def test_a_fit_tells_the_error_of_the_motion_that_it_fitted(model: afm.Model) -> None:
    known = model.scanner.axis("x").model_discrepancies
    assert [one.fitted for one in known] == [True, True]
    found = afm.diagnose(model, [record(20.0, 2.0, 3)])
    assert found.verdict == "model_sufficient"
    assert not any(isinstance(each, UntestedMotion) for each in found.scanner_diagnosis.cautions)


@pytest.mark.parametrize(
    ("volts", "gain"), [(1.0, 1.0), pytest.param(4.0, 1.1, marks=pytest.mark.evidence)]
)
def test_no_effect_is_found_where_the_error_is_not_known(
    model: afm.Model, volts: float, gain: float
) -> None:
    found = afm.diagnose(model, [record(20.0, volts, 4, gain=gain)])
    assert found.verdict != "effect_found"
    if found.verdict == "ambiguous":
        assert "while it is healthy" in str(found.next_experiment)
        assert "model_error" in [each.name for each in found.alternatives]
    (caution,) = (
        each for each in found.scanner_diagnosis.cautions if isinstance(each, UntestedMotion)
    )
    assert caution.tested is None
    assert caution.motion.low <= 20.0 <= caution.motion.high


@pytest.mark.evidence
def test_healthy_records_tell_the_error_of_their_motion(model: afm.Model) -> None:
    scan, healthy = record(10.0, 1.0, 5), record(10.0, 1.0, 6)
    found = afm.diagnose(model, [scan], healthy=[healthy])
    limit = found.scanner_diagnosis.noise_floor["x"]
    left = found.scanner_diagnosis.rms_before["x"]
    assert found.verdict == "model_sufficient"
    assert found.scanner_diagnosis.cautions[1:] == ()
    assert limit == pytest.approx(left, rel=0.1)
    known = found.model.scanner.axis("x").known_elsewhere[-1]
    assert known.record.startswith("healthy: 10 Hz, 1 V, 6")


def test_a_healthy_record_far_above_the_others_is_stated(model: afm.Model) -> None:
    """Of three records that are said to be healthy, one has another gain."""
    healthy = [record(20.0, 2.0, seed, gain=1.1 if seed == 9 else 1.0) for seed in (7, 8, 9)]
    found = afm.diagnose(model, [record(20.0, 2.0, 5)], healthy=healthy)
    unlike = found.scanner_diagnosis.unlike
    assert [(each.axis, each.record) for each in unlike] == [("x", "20 Hz, 2 V, 9")]
    assert "leave this record out" in caution_text(unlike[0])


def test_a_record_is_not_its_own_evidence(model: afm.Model) -> None:
    scan = record(10.0, 1.0, 5)
    with pytest.raises(afm.InputError, match="holds the same scan"):
        afm.diagnose(model, [scan], healthy=[scan])


def test_a_model_file_keeps_which_errors_are_of_a_fit(model: afm.Model, tmp_path: Path) -> None:
    model.save(tmp_path / "model.yaml")
    again = afm.load_model(tmp_path / "model.yaml").scanner.axis("x").model_discrepancies
    for one, other in zip(again, model.scanner.axis("x").model_discrepancies, strict=True):
        assert one.fitted == other.fitted
        np.testing.assert_allclose(one.rms, other.rms, rtol=1e-9)
