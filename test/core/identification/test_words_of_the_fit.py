"""What a fit says where a record's rate is another than it says, and where the model misses it."""

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


@pytest.mark.parametrize(
    ("kind", "factor"),
    [("creep", 0.5), ("creep", 2.0), ("hysteresis", 0.5), ("hysteresis", 2.0), ("frequency", 0.5)],
)
def test_another_sample_rate_is_refused(
    records: dict[str, AxisRecord], kind: str, factor: float
) -> None:
    with pytest.raises(InputError, match=r"each .*at the (sample )?rate (that )?it says"):
        identify_axis(**another_rate(records, kind, factor))


def test_another_sample_rate_is_warned_of(records: dict[str, AxisRecord]) -> None:
    report = identify_axis(**another_rate(records, "frequency", 2.0)).report
    assert any("sampled at another rate than it says" in text for text in report.records)


@pytest.fixture(scope="module")
def report(records: dict[str, AxisRecord]) -> AxisReport:
    return identify_axis(**records).report


def test_good_records_say_nothing_against_one_another(report: AxisReport) -> None:
    assert report.records == ()


@pytest.mark.parametrize(
    ("noise", "nonlinearity", "word"),
    [
        (0.003, 0.002, "the scanner has more modes there than the model"),
        (0.028, 0.01, "noise is 2.80% of it; drive harder"),
        (0.01, 0.028, "nonlinearity is 2.80% of it; drive with less amplitude"),
    ],
)
def test_a_misfit_is_laid_to_its_cause(
    report: AxisReport, noise: float, nonlinearity: float, word: str
) -> None:
    shares = {"noise_share": noise, "nonlinearity_share": nonlinearity}
    missed = evolve(report, vibration=evolve(report.vibration, misfit=0.03, **shares))
    (told,) = [text for text in missed.warnings if "misses the response by 3.00% rms" in text]
    assert told.endswith(word) or f"{word} or record" in told
