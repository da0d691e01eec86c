"""The number of states of a linear model, by records that were held out of its fit."""

from collections.abc import Iterator

import numpy as np
from scipy.stats import norm

from afm_scan_ros.core.identification.state_space.fit import COARSE_LINES, fit_state_space
from afm_scan_ros.core.identification.state_space.spectra import Spectra
from afm_scan_ros.core.types import Array, ProgressCallback

GROWTH = 1.25
"""From an order to the next that is tried."""
PATIENCE = 2
"""Orders in turn that do not help, after which no further one is tried."""
LEVEL = 0.05
"""Of the test whether one order's squared error is less than another's."""


def order_by_evidence(taught: Spectra, held_out: Spectra, progress: ProgressCallback) -> int:
    """Return the fewest states whose held-out error is not significantly above the least.

    Errors are compared line by line: lines of a random-phase drive are all but independent.
    """
    step = max(1, len(taught.omega) // COARSE_LINES)
    coarse, judge = taught.every(step), held_out.every(step)
    inputs, outputs = taught.inputs.shape[1], taught.outputs.shape[1]
    best, found, since = 0, np.full(len(judge.omega), np.inf), 0
    for order in _orders(max(inputs, outputs)):
        if since == PATIENCE or not _determined(order, coarse):
            break
        progress(f"a structure of {order} states")
        errors = _errors(coarse, judge, order)
        better = _less(errors, found)
        best, found, since = (order, errors, 0) if better else (best, found, since + 1)
    return best


def _orders(channels: int) -> Iterator[int]:
    """Even orders, from two states a channel on."""
    order = 2 * channels
    while True:
        yield order
        order = max(order + 2, 2 * round(GROWTH * order / 2.0))


def _determined(order: int, spectra: Spectra) -> bool:
    """Whether the lines are more than twice the parameters."""
    lines, inputs = spectra.inputs.shape[:2]
    outputs = spectra.outputs.shape[1]
    parameters = order * (inputs + outputs + 1) + inputs * outputs
    return bool(lines * inputs * outputs > 2 * parameters)


def _errors(taught: Spectra, held_out: Spectra, order: int) -> Array:
    """Squared simulation error of each held-out line, (lines,)."""
    model = fit_state_space(taught, order)
    error = model.response(held_out.omega) @ held_out.inputs - held_out.outputs
    return np.asarray(np.sum(np.abs(error) ** 2, axis=(1, 2)))


def _less(errors: Array, than: Array) -> bool:
    """Whether errors (lines,) are significantly less than others."""
    if not np.isfinite(than).all():
        return True
    gain = than - errors
    return bool(gain.mean() > norm.ppf(1.0 - LEVEL) * gain.std(ddof=1) / np.sqrt(len(gain)))
