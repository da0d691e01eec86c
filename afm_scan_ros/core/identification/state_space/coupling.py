"""Whether the drives of axes move each other's, by records in which all are driven at once."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as fisher

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.state_space.identify import levels_of
from afm_scan_ros.core.identification.state_space.periods import CoupledRecord, in_periods
from afm_scan_ros.core.identification.state_space.spectra import Spectra, periodic_records

CHANCE = 1e-3
"""Probability that an axis without coupling passes for a coupled one."""


def coupling_is_seen(records: Sequence[CoupledRecord]) -> bool:
    """Whether an axis follows all drives better than its own alone, by an F test.

    False where the records cannot tell: they are no multisines in steady state, or of fewer
    realisations than the drives and one more.
    """
    try:
        periods = in_periods(records)
    except InputError:
        return False
    levels = levels_of(records)
    inputs, outputs = periods.drive.shape[1], periods.output.shape[1]
    if inputs != outputs or min(map(len, levels)) <= inputs:
        return False
    drive, output = (signal[:, :, levels[-1]] for signal in (periods.drive, periods.output))
    spectra = periodic_records(drive, output, periods.sample_period, periods.used).spectra
    return any(_follows_others(spectra, axis) for axis in range(outputs))


def _follows_others(spectra: Spectra, axis: int) -> bool:
    lines, inputs, count = spectra.inputs.shape
    own, moved = spectra.inputs[:, axis], spectra.outputs[:, axis]
    gain = np.sum(moved * own.conj(), axis=1) / np.sum(np.abs(own) ** 2, axis=1)
    together = spectra.response()[:, [axis]] @ spectra.inputs
    alone, left = (
        float(np.sum(np.abs(moved - expected) ** 2))
        for expected in (gain[:, np.newaxis] * own, together[:, 0])
    )
    more, spare = 2 * lines * (inputs - 1), 2 * lines * (count - inputs)
    return bool((alone - left) / more > fisher.isf(CHANCE, more, spare) * left / spare)
