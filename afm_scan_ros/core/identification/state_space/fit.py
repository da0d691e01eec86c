"""Spectra → a stable state-space model of given order with the least simulation error."""

from afm_scan_ros.core.identification.state_space.gauss_newton import gauss_newton, squared_error
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.identification.state_space.subspace import subspace

COARSE_LINES = 900
"""Lines on which the starts are found and compared; the best of them is refined on all."""


def fit_state_space(spectra: Spectra, order: int) -> StateSpaceModel:
    """Fit ``order`` states by subspaces of two horizons, each refined on its simulation error.

    Two, since the error has several minima. Raises InputError where the lines are too few, or
    the records do not drive all inputs independently.
    """
    condensed = spectra.condensed()
    coarse = condensed.every(max(1, len(spectra.omega) // COARSE_LINES))
    starts = [subspace(coarse, order, horizon) for horizon in (order + 2, order + 6)]
    refined = [gauss_newton(start, coarse) for start in starts]
    best = min(refined, key=lambda form: squared_error(form, coarse))
    return gauss_newton(best, condensed).realised(spectra.sample_period)
