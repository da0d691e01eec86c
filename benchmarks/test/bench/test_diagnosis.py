"""The short form of the diagnosis bench: one effect, none, and how answers are judged."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from afm_scan_bench.diagnosis import diagnosis_healthy, diagnosis_plants
from afm_scan_bench.diagnosis.unmodelled.cases import (
    UnmodelledCase,
    drawn_case,
    effect_cases,
    healthy_cases,
)
from afm_scan_bench.diagnosis.unmodelled.judge import (
    CORRECT,
    MISLEADING,
    MISSED,
    NOT_EXPLAINED,
    PARTIAL,
    RESOLVED,
    UNDECIDED,
    UNRESOLVED,
    WRONG,
    Statement,
    judged,
)
from afm_scan_bench.diagnosis.unmodelled.runs import UnmodelledOutcome, run
from afm_scan_bench.diagnosis.unmodelled.sets import DEVELOPMENT_PLANTS
from afm_scan_bench.mechanisms.product_sizes import EFFECTS, SIZES
from afm_scan_bench.mechanisms.sizes import PAIRS
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    SUFFICIENT,
    UNEXPLAINED,
)

DELAY, LAG = ("delay", "x"), ("input_lag", "x")


def statement(
    verdict: str, *effects: tuple[str | None, str], competing_models: object = ()
) -> Statement:
    held = frozenset(effects)
    return Statement(verdict, held, held | frozenset(competing_models))  # type: ignore[call-overload]


def case(*effects: str) -> UnmodelledCase:
    return drawn_case(effects, "medium", DEVELOPMENT_PLANTS, 0)


EITHER = statement(AMBIGUOUS, LAG, competing_models=[DELAY])
NEITHER = statement(AMBIGUOUS, LAG, competing_models=[("drift", "x")])


@pytest.mark.parametrize(
    ("heard", "answer"),
    [
        ([statement(FOUND, DELAY)], CORRECT),
        ([statement(FOUND, LAG)], WRONG),
        ([statement(FOUND, ("delay", "y"))], WRONG),
        ([statement(FOUND, DELAY, LAG)], WRONG),
        ([EITHER, statement(FOUND, DELAY)], RESOLVED),
        ([EITHER, EITHER, statement(FOUND, DELAY)], RESOLVED),
        ([EITHER, statement(FOUND, LAG)], WRONG),
        ([EITHER, statement(AMBIGUOUS, DELAY, competing_models=[LAG])], UNRESOLVED),
        ([NEITHER, statement(FOUND, DELAY)], MISLEADING),
        ([EITHER, NEITHER, statement(FOUND, DELAY)], MISLEADING),
        ([statement(SUFFICIENT)], MISSED),
        ([statement(INSUFFICIENT), statement(INSUFFICIENT)], UNDECIDED),
        ([statement(INSUFFICIENT), statement(FOUND, DELAY)], CORRECT),
        ([statement(UNEXPLAINED)], NOT_EXPLAINED),
    ],
)
def test_a_delay_is_judged(heard: Sequence[Statement], answer: str) -> None:
    assert judged(case("delay"), heard) == answer


def test_what_is_outside_the_catalogue_must_not_be_named() -> None:
    assert judged(case("bow"), [statement(UNEXPLAINED)]) == CORRECT
    assert judged(case("bow"), [statement(FOUND, ("static_nonlinearity", "x"))]) == WRONG
    assert judged(case("bow"), [statement(SUFFICIENT)]) == MISSED


def test_of_a_pair_both_must_be_named() -> None:
    drift = ("drift", "x")
    assert judged(case("delay", "drift"), [statement(FOUND, DELAY, drift)]) == CORRECT
    assert judged(case("delay", "drift"), [statement(FOUND, DELAY)]) == PARTIAL
    assert judged(case("delay", "drift"), [statement(FOUND, DELAY, LAG)]) == WRONG


def test_without_an_effect_nothing_must_be_found() -> None:
    assert judged(case(), [statement(SUFFICIENT)]) == CORRECT
    assert judged(case(), [statement(FOUND, DELAY)]) == WRONG


def test_all_effects_and_pairs_are_there_at_all_sizes_on_drawn_plants() -> None:
    cases = list(effect_cases(DEVELOPMENT_PLANTS, sharing=3))
    every = {(c.effects, c.size) for c in cases}
    expected = {*((name,) for name in EFFECTS), *PAIRS}
    assert every == {(effects, size) for effects in expected for size in SIZES}
    assert len({c.scanner for c in cases}) == len(cases) / 3
    assert len({c.seed for c in cases}) == len(cases)


@pytest.fixture(scope="module")
def short() -> UnmodelledOutcome:
    """One case, from the scanner's calibration to the scans with the extended inverse."""
    return run(drawn_case(("delay",), "large", DEVELOPMENT_PLANTS, 0))


def test_a_large_delay_is_named_and_its_length_is_known(short: UnmodelledOutcome) -> None:
    assert short.answer == CORRECT
    assert short.size is not None
    assert short.size.ratio > 10.0
    assert [p.name for p in short.parameters] == ["delay delay"]
    assert short.parameters[0].inside


def test_the_extended_model_follows_nearly_as_the_healthy_one_did(short: UnmodelledOutcome) -> None:
    after = short.repeated
    assert after is not None
    assert after.tracking_before > 10.0
    assert after.tracking < 2.0


def test_healthy_scans_are_left_alone() -> None:
    table = diagnosis_healthy.table([run(each) for each in healthy_cases([DEVELOPMENT_PLANTS], 2)])
    assert "healthy scanner: 0 of 2" in table.title
    assert [(row["scans"], row["found"]) for row in table.rows] == [(2, 0)]


def test_the_table_reports_what_was_found_in_text_rows_and_picture(
    short: UnmodelledOutcome, tmp_path: Path
) -> None:
    table = diagnosis_plants.table("diagnosis", [short])
    assert "correct or resolved, ratio from 3 on: 1 of 1" in table.title
    assert [row["stated"] for row in table.rows] == ["delay"]
    table.save(tmp_path)
    assert (tmp_path / "diagnosis.png").stat().st_size > 0
