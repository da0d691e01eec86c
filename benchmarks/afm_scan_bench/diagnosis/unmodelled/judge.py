"""Compares a diagnosis with the true effects of the scanner."""

from collections.abc import Collection, Sequence

from attrs import frozen

from afm_scan_bench.diagnosis.unmodelled.cases import UnmodelledCase
from afm_scan_ros.core.diagnosis.axis_diagnosis import (
    AMBIGUOUS,
    FOUND,
    INSUFFICIENT,
    UNEXPLAINED,
)
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.diagnosis.settings import SEARCH

CORRECT, RESOLVED, UNRESOLVED = "correct", "resolved", "unresolved"
WRONG, MISLEADING, PARTIAL = "wrong", "misleading", "partial"
MISSED, UNDECIDED, NOT_EXPLAINED = "missed", "insufficient", "unexplained"
HELD = (CORRECT, RESOLVED, UNRESOLVED)
"""Answers that contain the truth."""

CLEAR = 3.0
"""Ratio of effect to detection limit from which on it should be correct or resolved."""

Name = tuple[str | None, str]
"""Of an effect and of its axis."""


@frozen
class Statement:
    """The statement of a diagnosis: its verdict, the effects, and all effects it leaves open."""

    verdict: str
    effects: frozenset[Name]
    open: frozenset[Name]

    @classmethod
    def by(cls, found: ScannerDiagnosis) -> "Statement":
        """The statement of ``found``."""
        effects = frozenset((e.name, e.axis) for e in found.effects)
        credible = frozenset(
            (name, axis)
            for axis, diagnosed in found.by_axis.items()
            if diagnosed.verdict == AMBIGUOUS
            for names in diagnosed.selection.posterior.credible(SEARCH.certain)
            for name in names
        )
        return cls(found.verdict, effects, effects | credible)

    @property
    def text(self) -> str:
        """Names of the effects where they are stated with confidence, else the verdict."""
        names = sorted({str(name) for name, _ in self.effects})
        return " + ".join(names) if self.verdict == FOUND else self.verdict


def judged(case: UnmodelledCase, statements: Sequence[Statement]) -> str:
    """Compare the first statement and those after each proposed experiment with the truth.

    A name counts with its axis. One false name makes the answer ``wrong``. A ``partial`` answer
    has no false name but not all true ones. ``misleading`` is an ambiguity without the truth.
    """
    truth = frozenset((name, case.axis) for name in case.truth)
    *before, last = statements
    doubts = [each for each in before if each.verdict == AMBIGUOUS]
    if not all(truth <= doubt.open for doubt in doubts):
        return MISLEADING
    final = _judged(truth, last)
    return RESOLVED if doubts and final == CORRECT else final


def _judged(truth: Collection[Name], statement: Statement) -> str:
    outside = any(name is None for name, _ in truth)
    if statement.verdict == FOUND:
        if statement.effects == truth:
            return CORRECT
        return PARTIAL if statement.effects.issubset(truth) else WRONG
    if statement.verdict == AMBIGUOUS:
        return UNRESOLVED if statement.open.issuperset(truth) else MISLEADING
    if statement.verdict == UNEXPLAINED:
        return CORRECT if outside else NOT_EXPLAINED
    if statement.verdict == INSUFFICIENT:
        return UNDECIDED
    return MISSED if truth else CORRECT
