"""What was selected, fitted once more before it is added to the model.

Selection needs stretches that no fit saw, and doubts where zero lies. The inverse needs neither:
all that was recorded tells of the parameters, and the model must be right from the scanner's rest
on, for there the desired displacement has its zero. The verdict and what is left are the
selection's.
"""

from collections.abc import Sequence

from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import Problem


def refit_on_all(
    evidence: Sequence[Evidence], chain: Chain, selected: FittedCandidates
) -> FittedCandidates:
    """Return the candidates with values and intervals from all records, where that fit succeeds."""
    forms = [candidate.form for candidate in selected.candidates]
    found = Problem(evidence, chain, forms, Evidence.whole).descend(selected.fit.rows)
    return evolve(selected, fit=found) if found else selected
