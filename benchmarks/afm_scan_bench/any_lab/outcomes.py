"""What became of a drawn diagnosis, and what it counts as."""

import numpy as np
from attrs import evolve, field, frozen

from afm_scan_bench.any_lab.effects import EVERY

RESULTS = {
    "named": "named",
    "partly": "one of two named",
    "credible": "ambiguous, the truth in the credible set",
    "uncovered": "ambiguous, the truth not in it",
    "unexplained": "unexplained",
    "missed": "sufficient or insufficient",
    "wrong": "a wrong name with confidence",
}


@frozen
class DiagnosisStatement:
    """A diagnosis of one axis: verdict, names that it states, and probabilities by set.

    ``limit``, ``before`` and ``after`` are rms in m, ``seconds`` those of the processor.
    """

    verdict: str
    stated: str
    probabilities: dict[str, float]
    limit: float
    before: float
    after: float
    seconds: float

    def credible(self, share: float) -> list[set[str]]:
        """The most probable sets of effects, which hold a share of the probability together."""
        ranked = sorted(self.probabilities.items(), key=lambda each: -each[1])
        reached = np.cumsum([probability for _, probability in ranked])
        return [names_of(name) for name, _ in ranked[: 1 + int(np.searchsorted(reached, share))]]

    def of_effect(self, name: str) -> float:
        """Probability of an effect, alone or beside others."""
        return sum(p for names, p in self.probabilities.items() if name in names_of(names))


def names_of(joined: str) -> set[str]:
    """Names that are joined by " + "; "none" is none."""
    return set(joined.split(" + ")) - {"none", ""}


@frozen
class DiagnosisOutcome:
    """What became of one case; ``times`` is the effect's size over the detection limit.

    ``known_scans`` of the healthy scanner were given, ``said`` is of the effect where not refused.
    """

    seed: int
    family: str
    protocol: str
    resonance: float
    reach: float
    known_scans: int
    refusal: str = ""
    effect: str = ""
    times: float = 0.0
    healthy: tuple[DiagnosisStatement, ...] = ()
    said: DiagnosisStatement | None = None
    seconds: float = field(default=0.0)

    @property
    def truth(self) -> set[str]:
        """Names of the effects in the catalogue, or "outside"."""
        return {EVERY[name].name for name in names_of(self.effect)}

    @property
    def result(self) -> str:
        """Return the result for the effect: one of ``RESULTS``."""
        if self.said is None:
            return "refused"
        stated = names_of(self.said.stated)
        if self.said.verdict == "effect_found":
            return "named" if stated == self.truth else "partly" if stated < self.truth else "wrong"
        if self.said.verdict == "ambiguous":
            return "credible" if self.truth in self.said.credible(0.95) else "uncovered"
        return "unexplained" if self.said.verdict == "unexplained" else "missed"


def read_outcome(row: dict[str, object]) -> DiagnosisOutcome:
    """Outcome of a line of a file of results."""
    said, healthy = row.pop("said"), row.pop("healthy")
    outcome = DiagnosisOutcome(**row)  # type: ignore[arg-type]
    if said is None:
        return outcome
    before = tuple(DiagnosisStatement(**each) for each in healthy)  # type: ignore[attr-defined]
    return evolve(outcome, said=DiagnosisStatement(**said), healthy=before)  # type: ignore[arg-type]
