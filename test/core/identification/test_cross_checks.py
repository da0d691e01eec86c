"""What only the other records show of a record: saturation, another scanner or rate, a cut end."""

from collections.abc import Mapping

import numpy as np
import pytest
from attrs import evolve
from small_plans import PLANS

from afm_scan_ros.core.identification.agreement import cross_findings, validation_findings
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.findings import (
    CreepGainMismatch,
    Finding,
    SaturatedRecord,
    SingleWave,
    UnfinishedRecord,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.validation import validate
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant

MODEL = load_model(share_directory() / "config" / "model.yaml")


def record(kind: str, axis: str, limit: float = np.inf) -> AxisRecord:
    """Record with an amplifier that gives no more than ``limit``, of the largest drive asked."""
    plan = PLANS[kind]
    asked = excitation_block(plan, 0, plan.total_samples)
    most = {name: limit * np.abs(asked.axis(name)).max() for name in AXES}
    given = evolve(asked, **{a: np.clip(asked.axis(a), -most[a], most[a]) for a in AXES})
    moved = Piezoscanner(default_plant(), plan.sample_period, 1).advance(given)[0]
    return AxisRecord(asked.axis(axis), moved.axis(axis), plan.sample_period)


@pytest.fixture(scope="module")
def good() -> dict[str, dict[str, AxisRecord]]:
    return {axis: {kind: record(kind, axis) for kind in PLANS} for axis in AXES}


def findings(model: AxisModel, records: Mapping[str, AxisRecord]) -> list[Finding]:
    validation = records["validation"]
    result = validate(model, validation, "validation")
    return [*cross_findings(model, **records), *validation_findings(validation, result)]


@pytest.mark.parametrize("axis", AXES)
def test_good_records_predict_one_another(
    good: dict[str, dict[str, AxisRecord]], axis: str
) -> None:
    assert findings(MODEL.axis(axis), good[axis]) == []


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("kind", ["creep", "frequency", "validation"])
def test_an_amplifier_at_its_limit_is_named(
    good: dict[str, dict[str, AxisRecord]], axis: str, kind: str
) -> None:
    found = findings(MODEL.axis(axis), good[axis] | {kind: record(kind, axis, limit=0.7)})
    if kind == "creep":
        assert any(isinstance(each, CreepGainMismatch) and each.ratio < 1.0 for each in found)
    else:
        saturated = [each for each in found if isinstance(each, SaturatedRecord)]
        assert kind in {each.record for each in saturated}


@pytest.mark.parametrize("kind", PLANS)
def test_a_record_cut_in_its_midst_is_named(
    good: dict[str, dict[str, AxisRecord]], kind: str
) -> None:
    whole = good["x"][kind]
    half = len(whole.drive) // 2
    cut = AxisRecord(whole.drive[:half], whole.displacement[:half], whole.sample_period)
    (found, *_) = findings(MODEL.x, good["x"] | {kind: cut})
    assert found == UnfinishedRecord(kind, cut.drive[0], cut.drive[-1])


def test_one_wave_is_named(good: dict[str, dict[str, AxisRecord]]) -> None:
    waves, period = good["x"]["frequency"], 6 * 1000
    one = AxisRecord(waves.drive[:period], waves.displacement[:period], waves.sample_period)
    found = findings(MODEL.x, good["x"] | {"frequency": one})
    assert SingleWave() in found


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_another_sample_rate_shows_in_the_validation(
    good: dict[str, dict[str, AxisRecord]], factor: float
) -> None:
    slow = evolve(good["x"]["validation"], sample_period=factor * 2e-5)
    found = findings(MODEL.x, good["x"] | {"validation": slow})
    assert any(isinstance(each, ValidationMismatch) and each.share > 0.02 for each in found)


def test_a_creep_record_of_a_smaller_scanner_is_named(
    good: dict[str, dict[str, AxisRecord]],
) -> None:
    creep = good["x"]["creep"]
    other = evolve(creep, displacement=0.85 * creep.displacement)
    (found,) = findings(MODEL.x, good["x"] | {"creep": other})
    assert isinstance(found, CreepGainMismatch)
    assert found.ratio == pytest.approx(0.85, abs=0.05)
