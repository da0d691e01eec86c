"""What was selected, fitted once more before it is added to the model.

Selection needs stretches that no fit saw, and doubts where zero lies. The inverse needs neither:
all that was recorded tells of the parameters, and the model must be right from the scanner's rest
on, for there the desired displacement has its zero. The verdict and what is left are the
selection's.
"""

from collections.abc import Sequence

from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.diagnosis.fit import Problem
from afm_scan_ros.core.diagnosis.trial import Trial


def settled(evidence: Sequence[Evidence], chain: Chain, kept: Trial) -> Trial:
    """Trial with its values and intervals from all of the records, if they can be fitted so."""
    forms = [candidate.form for candidate in kept.candidates]
    found = Problem(evidence, chain, forms, Evidence.whole).descend(kept.fit.rows)
    return evolve(kept, fit=found) if found else kept
