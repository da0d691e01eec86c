"""What general sparse regression finds in the residuals that are diagnosed, beside the diagnosis.

Records are those of drawn diagnoses: of each seed three healthy scans and one with an effect.
"""

from collections.abc import Iterator, Sequence

from attrs import frozen

import afm_scan_ros as afm
from afm_scan_bench.any_lab.diagnosis import HEALTHY, calibrated, drawn, with_effect
from afm_scan_bench.any_lab.effects import EVERY
from afm_scan_bench.any_lab.outcomes import DiagnosisStatement, names_of
from afm_scan_bench.diagnosis.term_selection import (
    METHODS,
    effects_of,
    require_libraries,
    scaled,
    terms_of,
)
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.report.table import Row, Table

SEEDS = 0, 2, 3, 4, 6, 9, 12, 15, 18, 21
"""Of development cases."""
LONGEST = 4000
"""Samples that regression is given at most: of a longer record every second, third, or so on."""
COLUMNS = {
    "method": ("method", ""),
    "false": ("something in a healthy scan", "d"),
    "healthy": ("of", "d"),
    "found": ("something in a scan with an effect", "d"),
    "right": ("right", "d"),
    "effects": ("of", "d"),
}


@frozen(eq=False)
class RivalCase:
    """A record, the model that predicts it, true effects, and the diagnosis; healthy has none."""

    model: afm.Model
    record: afm.Record
    truth: set[str]
    statement: DiagnosisStatement


Verdict = tuple[bool, bool]
"""Whether something was found, and whether that is right."""


def measure() -> Table:
    """Count what each method finds; raises InputError where a library is missing."""
    require_libraries()
    return table([case for seed in SEEDS for case in cases(seed)])


def table(tried: Sequence[RivalCase]) -> Table:
    """One row a method."""
    rows = [_row("this package", tried, [diagnosed(case.statement, case.truth) for case in tried])]
    found = [selected(case) for case in tried]
    rows += [_row(name, tried, [each[name] for each in found]) for name in METHODS]
    return Table("rivals", "What is found in scans of drawn scanners", COLUMNS, rows)


def _row(method: str, tried: Sequence[RivalCase], found: Sequence[Verdict]) -> Row:
    healthy = [verdict for case, verdict in zip(tried, found, strict=True) if not case.truth]
    effects = [verdict for case, verdict in zip(tried, found, strict=True) if case.truth]
    return {
        "method": method,
        "false": sum(something for something, _ in healthy),
        "healthy": len(healthy),
        "found": sum(something for something, _ in effects),
        "right": sum(right for _, right in effects),
        "effects": len(effects),
    }


def diagnosed(statement: DiagnosisStatement, truth: set[str]) -> Verdict:
    """Judge a diagnosis: all effects are named, or are in the 95 % credible set."""
    if statement.verdict == "effect_found":
        return True, names_of(statement.stated) == truth
    if statement.verdict == "ambiguous":
        return True, truth in statement.credible(0.95)
    unexplained = statement.verdict == "unexplained"
    return unexplained, unexplained and truth == {"outside"}


def selected(case: RivalCase) -> dict[str, Verdict]:
    """Judge each method: its dominant term stands for one effect of the scan."""
    position = case.model.predict(case.record.drive, case.record.sample_period)[:, 0]
    kept = slice(None, None, -(-len(position) // LONGEST))
    terms = terms_of(position)[kept]
    residual = scaled(case.record.displacement[:, 0] - position)[kept]
    named = {name: effects_of(method(terms, residual)) for name, method in METHODS.items()}
    return {name: (bool(found), bool(found & case.truth)) for name, found in named.items()}


def cases(seed: int) -> Iterator[RivalCase]:
    """Cases of a scanner; none where it is refused."""
    try:
        laboratory = calibrated(*drawn(seed))
        drives = [laboratory.scan() for _ in range(HEALTHY)]
        healthy = [laboratory.healthy_record(drive) for drive in drives]
        statement = [laboratory.diagnosed(record) for record in healthy]
        effect, _, record = with_effect(laboratory, seed, drives[0], statement[0].limit)
        truth = {EVERY[name].name for name in names_of(effect)}
        last = RivalCase(laboratory.model, record, truth, laboratory.diagnosed(record))
    except (InputError, ScanError):
        return
    for one, verdict in zip(healthy, statement, strict=True):
        yield RivalCase(laboratory.model, one, set(), verdict)
    yield last
