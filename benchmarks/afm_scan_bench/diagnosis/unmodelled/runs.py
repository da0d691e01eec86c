"""Runs cases: scan, diagnose, record proposed experiments, compare with the truth, scan again."""

import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
from operator import attrgetter

from attrs import evolve, frozen

from afm_scan_bench.diagnosis.unmodelled.after import Repeated, repeated
from afm_scan_bench.diagnosis.unmodelled.cases import UnmodelledCase
from afm_scan_bench.diagnosis.unmodelled.judge import HELD, Statement, judged
from afm_scan_bench.diagnosis.unmodelled.parameters import ParameterComparison, compared
from afm_scan_bench.diagnosis.unmodelled.scanner import Size, healthy_scanner, size_of
from afm_scan_bench.session import InProcessSession
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.closed_loop import FIRST, diagnose_until_resolved
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.record import Record

PROCESSES = 2


@frozen(eq=False)
class UnmodelledOutcome:
    """The statements on a case, at first and after each experiment, and the ``answer``.

    ``seconds`` is the time of the diagnosis. ``size`` is None where there is no effect. The fields
    ``repeated`` and ``parameters`` are empty unless the effect is among those found.
    """

    case: UnmodelledCase
    statements: tuple[Statement, ...]
    experiments: tuple[str, ...]
    answer: str
    seconds: float
    size: Size | None
    repeated: Repeated | None
    parameters: tuple[ParameterComparison, ...]


def run(case: UnmodelledCase) -> UnmodelledOutcome:
    """Run one case; the diagnosis gets the drive, the measured displacement and the model."""
    healthy, model = healthy_scanner(*case.scanner)
    where = InProcessSession(evolve(healthy, mechanisms=case.mechanisms), case.seed)
    done = where.scan(FIRST, case.spec, model)
    began = time.perf_counter()
    record = Record.of_traces(FIRST, done.drive, done.measured, case.spec)
    experiments = dict[str, Record]()
    found = list(diagnose_until_resolved(where, model, [record], experiments, diagnose))
    seconds = time.perf_counter() - began
    statements = tuple(map(Statement.by, found))
    answer = judged(case, statements)
    held = found[-1] if _in_catalogue(case) and answer in HELD else None
    twin = InProcessSession(healthy, case.seed)
    return UnmodelledOutcome(
        case=case,
        statements=statements,
        experiments=tuple(experiments),
        answer=answer,
        seconds=seconds,
        size=size_of(case, healthy, model, done) if case.effects else None,
        repeated=repeated(case.axis, case.spec, where, twin, (model, held.model)) if held else None,
        parameters=tuple(_compared(case, held)) if held else (),
    )


def outcomes(cases: Iterable[UnmodelledCase]) -> list[UnmodelledOutcome]:
    """Run cases, those of one scanner after each other, in two processes."""
    by_scanner = [list(group) for _, group in groupby(cases, attrgetter("scanner"))]
    found: list[UnmodelledOutcome] = []
    with ProcessPoolExecutor(PROCESSES) as pool, working("diagnosing") as progress:
        for number, some in enumerate(pool.map(_run_all, by_scanner), start=1):
            found += some
            progress(f"{number} of {len(by_scanner)} scanners")
    return found


def _run_all(cases: Sequence[UnmodelledCase]) -> list[UnmodelledOutcome]:
    return [run(case) for case in cases]


def _in_catalogue(case: UnmodelledCase) -> bool:
    return bool(case.effects) and None not in case.truth


def _compared(case: UnmodelledCase, found: ScannerDiagnosis) -> Iterator[ParameterComparison]:
    for mechanism in case.mechanisms:
        yield from compared(mechanism, found)
