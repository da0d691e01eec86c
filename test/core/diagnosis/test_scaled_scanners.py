"""A diagnosis does not depend on the units of length, voltage and time."""

import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.axis_diagnosis import FOUND, SUFFICIENT
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.model import Added, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import predict
from helpers.in_process import ALL, default_model, scan
from helpers.scaling import scaled_axis, scaled_record

SPEC = ScanSpec(line_rate=20.0, lines=6, samples_per_line=500)
EFFECTS = {
    "static_nonlinearity": Added("static_nonlinearity", "odd", (1e8,)),
    "extra_resonance": Added("extra_resonance", "parallel", (0.05, 700.0, 0.02)),
    "drift": Added("drift", "", (5e-6, 0.2)),
    "": None,
}
FAINT = 1e-3
CASES = [
    ("static_nonlinearity", Scale(0.01, 100.0, 0.01)),
    ("extra_resonance", Scale(20.0, 0.01, 100.0)),
    ("drift", Scale(0.01, 0.01, 100.0)),
    ("", Scale(20.0, 100.0, 0.01)),
]


@pytest.fixture(scope="module")
def healthy() -> Record:
    done = scan(SPEC, ALL)
    return Record.of_traces("scan", done.drive, done.measured, SPEC, axes=("x",))


def diagnosed(name: str, healthy: Record, scale: Scale) -> ScannerDiagnosis:
    model, effect = ScannerModel(x=default_model().x), EFFECTS[name]
    with_it = evolve(model, x=evolve(model.x, added=(effect,) if effect else ()))
    drive, _ = healthy.traces()
    moved = predict(with_it, drive).x - predict(model, drive).x
    record = evolve(healthy, displacement=healthy.displacement[:, 0] + moved)
    return diagnose(ScannerModel(x=scaled_axis(model.x, scale)), [scaled_record(record, scale)])


@pytest.mark.evidence
@pytest.mark.parametrize(("name", "scale"), CASES)
def test_verdict_and_probabilities_are_those_of_the_reference(
    name: str, scale: Scale, healthy: Record
) -> None:
    before, found = (diagnosed(name, healthy, each) for each in (Scale(), scale))
    assert before.verdict == (FOUND if name else SUFFICIENT)
    assert [effect.name for effect in before.effects] == ([name] if name else [])
    assert found.verdict == before.verdict
    one, other = (each.probabilities["x"] for each in (before, found))
    both = dict.fromkeys((*one, *other), 0.0)
    assert {**both, **other} == pytest.approx({**both, **one}, abs=FAINT)
    assert found.rms_after["x"] == pytest.approx(scale.length * before.rms_after["x"], rel=1e-3)
