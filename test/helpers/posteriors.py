"""The hypothesis without an effect, for tests of what is selected."""

import numpy as np

from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.diagnosis.fit import Fit
from afm_scan_ros.core.diagnosis.likelihood import CellFit


def no_effect(cells: CellFit) -> FittedCandidates:
    """Return the fit of no candidate, which leaves so much in the cells."""
    return FittedCandidates((), Fit(np.empty((1, 0)), np.empty(0)), cells)
