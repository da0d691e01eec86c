"""Frequency-domain subspace identification: spectra → modes, without a start and without iteration.

McKelvey, Akçay and Ljung, Subspace-based multivariable system identification from frequency
response data, IEEE Transactions on Automatic Control 41 (1996) 960-979, algorithm 2, with records
of inputs and outputs in place of the response.
"""

import numpy as np
from scipy.linalg import qr

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.gauss_newton import with_linear_part
from afm_scan_ros.core.identification.state_space.model import Complex
from afm_scan_ros.core.identification.state_space.modes import ModalForm, modal_form
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array


def subspace(spectra: Spectra, order: int, horizon: int) -> ModalForm:
    """Return a stable model with ``order`` states from matrices of ``horizon`` block rows.

    Raises InputError where the horizon is too short for the order, or the lines are too few.
    """
    inputs, outputs = spectra.inputs.shape[1], spectra.outputs.shape[1]
    rows = horizon * (inputs + outputs)
    if (horizon - 1) * outputs < order:
        raise InputError(f"subspace: a horizon of {horizon} is too short for {order} states")
    if 2 * len(spectra.omega) * spectra.inputs.shape[2] < rows:
        raise InputError(f"subspace: {len(spectra.omega)} lines are too few for {rows} rows")
    driven, followed = (_shifted(spectra.z, s, horizon) for s in (spectra.inputs, spectra.outputs))
    triangle = qr(np.vstack([driven, followed]).T, mode="r", overwrite_a=True)[0]
    free = triangle[horizon * inputs : rows, horizon * inputs :].T
    observability = np.linalg.svd(free)[0][:, :order]
    a = np.linalg.lstsq(observability[:-outputs], observability[outputs:], rcond=None)[0]
    c = observability[:outputs]
    poles = modal_form(a, np.zeros((order, inputs)), c, np.zeros((outputs, inputs)))
    return with_linear_part(poles, spectra)


def _shifted(z: Complex, signals: Complex, horizon: int) -> Array:
    """Stack z⁰, z¹, … times the signals: (horizon · channels, 2 · lines · records), real."""
    powers = z ** np.arange(horizon)[:, np.newaxis]
    stacked = np.einsum("hk,kcr->hckr", powers, signals)
    wide = stacked.reshape(horizon * signals.shape[1], -1)
    return np.hstack([wide.real, wide.imag])
