"""Candidates tried on one axis: fitted to what teaches, scored on what tests."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.catalogue import CATALOGUE
from afm_scan_ros.core.catalogue.entry import Entry, Form
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.tracing.clues import Clues
from afm_scan_ros.core.tracing.evidence import Evidence, misfit
from afm_scan_ros.core.tracing.fit import Fit, fit, inserted


@frozen(eq=False)
class Candidate:
    """A form of a catalogue entry."""

    entry: Entry
    form: Form


CANDIDATES = tuple(Candidate(entry, form) for entry in CATALOGUE for form in entry.forms)


@frozen(eq=False)
class Trial:
    """Candidates fitted together, and the misfit they leave on what tests."""

    candidates: tuple[Candidate, ...]
    fit: Fit
    misfit: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(candidate.entry.name for candidate in self.candidates)

    def extended(self, chain: Chain) -> Chain:
        """Chain with the candidates at the fitted values."""
        return inserted(chain, [c.form for c in self.candidates], self.fit.values)


def try_with(
    evidence: Sequence[Evidence],
    chain: Chain,
    kept: Trial | None,
    candidate: Candidate,
    clues: Clues,
) -> Trial | None:
    """Fit a candidate together with those already kept; None where it cannot be applied."""
    before = kept.candidates if kept else ()
    values = tuple(kept.fit.values) if kept else ()
    starts = [(*values, *start) for start in candidate.form.starts(clues)]
    return _tried(evidence, chain, (*before, candidate), starts)


def try_without(
    evidence: Sequence[Evidence], chain: Chain, kept: Trial, dropped: int
) -> Trial | None:
    """Fit what is kept but for one of the candidates; None where nothing is left to fit."""
    rest = tuple(c for i, c in enumerate(kept.candidates) if i != dropped)
    sizes = [len(c.form.parameters) for c in kept.candidates]
    owner = np.repeat(np.arange(len(sizes)), sizes)
    if not rest:
        return None
    return _tried(evidence, chain, rest, [tuple(kept.fit.values[owner != dropped])])


def _tried(
    evidence: Sequence[Evidence],
    chain: Chain,
    candidates: tuple[Candidate, ...],
    starts: Sequence[Sequence[float]],
) -> Trial | None:
    forms = [c.form for c in candidates]
    found = fit(evidence, chain, forms, starts)
    if found is None:
        return None
    left = misfit(evidence, inserted(chain, forms, found.values), taught=False)
    return Trial(candidates, found, left)
