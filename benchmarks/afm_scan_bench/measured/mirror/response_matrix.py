"""The response between all inputs and outputs of periodic records, with noise and nonlinearity."""

import numpy as np
from attrs import frozen

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.spectra import PeriodicRecords, smooth
from afm_scan_ros.core.types import Array, Complex


@frozen(eq=False)
class ResponseMatrix:
    """Response (lines, p, m) with two standard deviations of it, the same shape.

    ``noise``: from period to period. ``nonlinear``: from realisation to realisation, beyond noise.
    """

    omega: Array
    response: Complex
    noise: Array
    nonlinear: Array


def response_matrix(records: PeriodicRecords) -> ResponseMatrix:
    """Response as mean over the sets of m records that follow each other.

    The records of a set should be orthogonal. Raises InputError where two sets are not there.
    """
    inputs, count = records.spectra.inputs.shape[1:]
    if count < 2 * inputs:
        raise InputError(f"{count} records of {inputs} inputs: two sets of {inputs} are needed")
    sets = [list(range(k, k + inputs)) for k in range(0, count - inputs + 1, inputs)]
    found, noises = [], []
    for chosen in sets:
        inverse = np.linalg.inv(records.spectra.inputs[:, :, chosen])
        found.append(records.spectra.outputs[:, :, chosen] @ inverse)
        noises.append(records.noise[:, :, chosen] @ np.abs(inverse) ** 2)
    noise = smooth(np.mean(noises, axis=0)) / len(sets)
    scatter = smooth(np.var(found, axis=0, ddof=1)) / len(sets)
    nonlinear = np.sqrt(np.maximum(scatter - noise, 0.0))
    mean = np.mean(found, axis=0)
    return ResponseMatrix(records.spectra.omega, mean, np.sqrt(noise), nonlinear)
