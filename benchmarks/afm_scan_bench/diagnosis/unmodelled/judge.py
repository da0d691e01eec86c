"""What a diagnosis is worth, to whoever knows what the scanner has."""

from collections.abc import Collection, Sequence

from attrs import frozen

from afm_scan_bench.diagnosis.unmodelled.cases import Case
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, FOUND, INSUFFICIENT, UNEXPLAINED
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis

RIGHT, SETTLED, UNSETTLED = "right", "settled", "unsettled"
WRONG, ASTRAY, PARTLY = "wrong", "astray", "partly"
MISSED, UNDECIDED, NOT_EXPLAINED = "missed", "insufficient", "unexplained"
HELD = (RIGHT, SETTLED, UNSETTLED)
"""What is said holds the truth."""

CLEAR = 3.0
"""Effect over floor from which on it must be named, or settled."""

Name = tuple[str | None, str]
"""Of an effect and of its axis."""


@frozen
class Said:
    """What a diagnosis says: its verdict, the effects, and all that it leaves open."""

    verdict: str
    effects: frozenset[Name]
    open: frozenset[Name]

    @classmethod
    def by(cls, found: ScannerDiagnosis) -> "Said":
        """What ``found`` says."""
        effects = frozenset((e.name, e.axis) for e in found.effects)
        competing_models = frozenset(
            (competing.candidate.effect.name, axis)
            for axis, trace in found.by_axis.items()
            if trace.verdict == AMBIGUOUS
            for competing in trace.selection.competing_models
        )
        return cls(found.verdict, effects, effects | competing_models)

    @property
    def words(self) -> str:
        """Names of the effects where they are stated with confidence, else the verdict."""
        names = sorted({str(name) for name, _ in self.effects})
        return " + ".join(names) if self.verdict == FOUND else self.verdict


def judged(case: Case, said: Sequence[Said]) -> str:
    """Judge what was said at first and, where they were run, after each proposed experiment.

    A name counts with its axis, and one too many makes a wrong one; ``partly`` names no wrong one,
    but not all. ``astray`` is a declared ambiguity that does not hold the truth, at any stage.
    """
    truth = frozenset((name, case.axis) for name in case.truth)
    *before, last = said
    doubts = [each for each in before if each.verdict == AMBIGUOUS]
    if not all(truth <= doubt.open for doubt in doubts):
        return ASTRAY
    final = _judged(truth, last)
    return SETTLED if doubts and final == RIGHT else final


def _judged(truth: Collection[Name], said: Said) -> str:
    outside = any(name is None for name, _ in truth)
    if said.verdict == FOUND:
        if said.effects == truth:
            return RIGHT
        return PARTLY if said.effects.issubset(truth) else WRONG
    if said.verdict == AMBIGUOUS:
        return UNSETTLED if said.open.issuperset(truth) else ASTRAY
    if said.verdict == UNEXPLAINED:
        return RIGHT if outside else NOT_EXPLAINED
    if said.verdict == INSUFFICIENT:
        return UNDECIDED
    return MISSED if truth else RIGHT
