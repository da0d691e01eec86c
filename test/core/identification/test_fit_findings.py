"""What is found where a record's sample rate is wrong, and where the model does not fit."""

from collections.abc import Mapping

import pytest
from attrs import evolve
from small_plans import PLANS

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.alternating import AxisRecord
from afm_scan_ros.core.identification.drives.excitation import (
    creep_plan,
    excitation_block,
    hysteresis_plan,
)
from afm_scan_ros.core.identification.findings import (
    MisfitCause,
    ResponseMisfit,
    ValidationMismatch,
)
from afm_scan_ros.core.identification.fit_report import AxisReport
from afm_scan_ros.core.identification.identify import identify_axis
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant

LONGER = {"creep": creep_plan((600.0, 200.0)), "hysteresis": hysteresis_plan(levels=13)}


@pytest.fixture(scope="module")
def records() -> dict[str, AxisRecord]:
    made = {}
    for kind, plan in (PLANS | LONGER).items():
        drive = excitation_block(plan, 0, plan.total_samples)
        moved = Piezoscanner(default_plant(), plan.sample_period, 1).advance(drive)[0]
        made[kind] = AxisRecord(drive.x, moved.x, plan.sample_period)
    return made


def another_rate(
    records: Mapping[str, AxisRecord], kind: str, factor: float
) -> dict[str, AxisRecord]:
    period = records[kind].sample_period
    return {**records, kind: evolve(records[kind], sample_period=factor * period)}


@pytest.mark.parametrize(("kind", "factor"), [("creep", 2.0), ("hysteresis", 0.5)])
@pytest.mark.evidence
def test_another_sample_rate_is_refused_or_warned_of(
    records: dict[str, AxisRecord], kind: str, factor: float
) -> None:
    try:
        report = identify_axis(**another_rate(records, kind, factor)).report
    except InputError:
        return
    assert any(isinstance(each, ValidationMismatch) for each in report.records)


@pytest.mark.evidence
def test_another_sample_rate_is_warned_of(records: dict[str, AxisRecord]) -> None:
    report = identify_axis(**another_rate(records, "frequency", 2.0)).report
    assert any(isinstance(each, ValidationMismatch) for each in report.records)


@pytest.fixture(scope="module")
def report(records: dict[str, AxisRecord]) -> AxisReport:
    return identify_axis(**records).report


@pytest.mark.evidence
def test_good_records_agree_with_one_another(report: AxisReport) -> None:
    assert report.records == ()


@pytest.mark.evidence
@pytest.mark.parametrize(
    ("noise", "nonlinearity", "cause", "share"),
    [
        (0.003, 0.002, MisfitCause.MODES, 0.03),
        (0.028, 0.01, MisfitCause.NOISE, 0.028),
        (0.01, 0.028, MisfitCause.NONLINEARITY, 0.028),
    ],
)
def test_a_misfit_has_a_cause(
    report: AxisReport, noise: float, nonlinearity: float, cause: MisfitCause, share: float
) -> None:
    shares = {"noise_share": noise, "nonlinearity_share": nonlinearity}
    missed = evolve(report, vibration=evolve(report.vibration, misfit=0.03, **shares))
    (found,) = [each for each in missed.warnings if isinstance(each, ResponseMisfit)]
    assert found == ResponseMisfit(0.03, report.vibration.band, cause, share)
