"""A record of a frequency response's drive, periodic or swept → the response.

The input is the hysteresis' output F = H(u), not the drive u: the hysteresis' own gain and lag
would otherwise be taken for the vibration's.
"""

import numpy as np

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.periodic import record_spectra
from afm_scan_ros.core.identification.vibration.spectra import response_matrix
from afm_scan_ros.core.identification.vibration.swept import is_sweep, swept_response
from afm_scan_ros.core.types import Array

__all__ = ["FrequencyResponse", "frequency_response"]


def frequency_response(
    drive: Array, effective: Array, output: Array, sample_period: float
) -> FrequencyResponse:
    """Response of ``output`` to ``effective``, all of shape (n,), where ``drive`` shows it.

    A single sweep is taken whole. Of any other drive a period counts when it equals the period
    before, so that it is steady, and of several amplitudes the largest. Raises InputError where
    no two periods in succession are steady.
    """
    if is_sweep(drive):
        return swept_response(drive, effective, output, sample_period)
    drives, inputs, outputs = (s[:, np.newaxis] for s in (drive, effective, output))
    strongest = record_spectra(drives, inputs, outputs, sample_period).levels()[0]
    return FrequencyResponse.between(response_matrix(strongest), output=0, given=0)
