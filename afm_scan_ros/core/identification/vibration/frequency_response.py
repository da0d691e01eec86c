"""A record of any drive that reaches beyond the resonance → the frequency response.

The input is the hysteresis' output F = H(u), not the drive u: the hysteresis' own gain and lag
would otherwise be taken for the vibration's.
"""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.local_response import local_response
from afm_scan_ros.core.identification.vibration.periodic import (
    is_periodic,
    record_spectra,
    refuse_out_of_step,
)
from afm_scan_ros.core.identification.vibration.spectra import response_matrix
from afm_scan_ros.core.identification.vibration.swept import distortion, is_sweep
from afm_scan_ros.core.types import Array

__all__ = ["FrequencyResponse", "frequency_response"]


def frequency_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective``, all of shape (n,), where ``drive`` shows it.

    Of a periodic drive a period counts when it equals the period before, so that it is steady, and
    of several amplitudes the largest. Sweeps, noise and steps are taken whole. Raises InputError
    of a drive that nearly repeats.
    """
    swept = is_sweep(drive)
    if not swept and is_periodic(drive[:, np.newaxis]):
        drives, inputs, outputs = (s[:, np.newaxis] for s in (drive, effective, output))
        strongest = record_spectra(drives, inputs, outputs, sample_period).levels()[0]
        steady = FrequencyResponse.between(response_matrix(strongest), output=0, given=0)
        return steady if len(strongest.inputs) > 1 else steady.with_distortion()
    if not swept:
        refuse_out_of_step(drive[:, np.newaxis])
    found = local_response(drive, effective, output, sample_period)
    if not swept:
        return found.response
    return evolve(found.response, distortion=distortion(drive, output, found))
