"""One model of the fine steering mirror for all amplitudes, beside the authors'."""

from collections.abc import Callable

import numpy as np

from afm_scan_bench.measured.mirror.extended_fits import (
    FOLDS,
    STATES,
    Fold,
    extended,
    left_out_errors,
    linear,
    linear_of_all,
    percent,
)
from afm_scan_bench.measured.mirror.fits import AMPLITUDES
from afm_scan_ros.core.identification.state_space.feedback import FeedbackModel
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.report.table import Row, Table

AUTHORS = {100: (18.61, 8.38, 6.37), 200: (6.61, 7.95, 4.84), 300: (16.28, 5.63, 4.19)}
"""The authors' rms errors in %, on test realisations of theirs, with 28 states: one linear model of
all amplitudes, a linear one of each, and one of all with a neural network in its feedback (Floren,
baseline models v2026.04.15, 10.5281/zenodo.19591136)."""

COLUMNS = {
    "amplitude_mv": ("mV", "d"),
    "before_percent": ("one linear", ".2f"),
    "after_percent": ("extended", ".2f"),
    "worst_percent": ("worst", ".2f"),
    "each_percent": ("each linear", ".2f"),
    "authors_before_percent": ("authors: one linear", ".2f"),
    "authors_each_percent": ("each linear", ".2f"),
    "authors_network_percent": ("network", ".2f"),
}
TITLE = (
    "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
    "One model of all amplitudes: simulation error on held-out realisations,\n"
    "rms in % of the output's rms, mean over six in three folds.\n"
    f"Extended: softening in feedback, slips at the inputs; {STATES} states.\n"
    "Each linear: a model of that amplitude alone. Authors: 28 states, their test data"
)


def measure() -> Table:
    """Fit in three folds and simulate the steady state of what each left out."""
    return Table("fsm_extended", TITLE, COLUMNS, [_row(amplitude) for amplitude in AMPLITUDES])


def _row(amplitude: int) -> Row:
    squares = [left_out_errors(extended(fold), amplitude, fold) for fold in FOLDS]
    each = {
        k: percent(part[:, :, [i]])
        for fold, part in zip(FOLDS, squares, strict=True)
        for i, k in enumerate(fold)
    }
    before, own, network = AUTHORS[amplitude]
    return {
        "amplitude_mv": amplitude,
        "states": STATES,
        "before_percent": _mean(linear_of_all, amplitude),
        "after_percent": float(np.mean(list(each.values()))),
        "worst_percent": max(each.values()),
        **{
            f"channel_{k}_percent": float(np.mean([percent(part[:, [k - 1]]) for part in squares]))
            for k in (1, 2, 3)
        },
        **{f"realisation_{k}_percent": each[k] for k in sorted(each)},
        "each_percent": _mean(lambda fold: linear(amplitude, fold), amplitude),
        "authors_before_percent": before,
        "authors_each_percent": own,
        "authors_network_percent": network,
    }


def _mean(model: Callable[[Fold], StateSpaceModel | FeedbackModel], amplitude: int) -> float:
    """Error in % on the held-out realisations of each fold, mean over the folds."""
    return float(np.mean([percent(left_out_errors(model(k), amplitude, k)) for k in FOLDS]))
