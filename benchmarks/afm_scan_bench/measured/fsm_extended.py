"""One model of the fine steering mirror for all amplitudes, beside the authors'."""

import numpy as np

from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    EFFECTS,
    FOLDS,
    identified,
    percent,
    predicted,
    score,
    squares,
)
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

STATES = 36
AUTHORS = {100: (18.61, 8.38, 6.37), 200: (6.61, 7.95, 4.84), 300: (16.28, 5.63, 4.19)}
"""The authors' rms errors in %, on test realisations of theirs, with 28 states: one linear model of
all amplitudes, a linear one of each, and one of all with a neural network in its feedback (Floren,
baseline models v2026.04.15, 10.5281/zenodo.19591136)."""

COLUMNS = {
    "amplitude_mv": ("mV", "d"),
    "before_percent": ("one linear", ".2f"),
    "after_percent": ("extended", ".2f"),
    "worst_percent": ("worst", ".2f"),
    "score_um": ("score, um", ".4f"),
    "each_percent": ("each linear", ".2f"),
    "authors_before_percent": ("authors: one linear", ".2f"),
    "authors_each_percent": ("each linear", ".2f"),
    "authors_network_percent": ("network", ".2f"),
}
TITLE = (
    "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
    "One model of all amplitudes: simulation error on held-out realisations,\n"
    "rms in % of the output's rms, mean over six in three folds.\n"
    f"Extended: {' and '.join(EFFECTS)}; {STATES} states.\n"
    "Score: the benchmark's rmse. Each linear: a model of that amplitude alone.\n"
    "Authors: 28 states, their test data"
)


def measure() -> Table:
    """Fit in three folds and simulate the steady state of what each left out."""
    return Table("fsm_extended", TITLE, COLUMNS, [_row(amplitude) for amplitude in AMPLITUDES])


def _row(amplitude: int) -> Row:
    extended = _simulated(AMPLITUDES, amplitude, EFFECTS)
    errors = {k: squares(simulation, amplitude, k) for k, simulation in extended.items()}
    each = {k: percent(error) for k, error in errors.items()}
    scores = {k: 1e6 * score(simulation, amplitude, k) for k, simulation in extended.items()}
    channels = [np.mean([percent(error[:, [k]]) for error in errors.values()]) for k in range(3)]
    before, own, network = AUTHORS[amplitude]
    return {
        "amplitude_mv": amplitude,
        "states": STATES,
        "before_percent": _mean(_simulated(AMPLITUDES, amplitude), amplitude),
        "after_percent": float(np.mean(list(each.values()))),
        "worst_percent": max(each.values()),
        **{f"channel_{k}_percent": float(channels[k - 1]) for k in (1, 2, 3)},
        **{f"realisation_{k}_percent": each[k] for k in sorted(each)},
        **{f"score_{k}_um": scores[k] for k in sorted(scores)},
        "score_um": float(np.mean(list(scores.values()))),
        "each_percent": _mean(_simulated((amplitude,), amplitude), amplitude),
        "authors_before_percent": before,
        "authors_each_percent": own,
        "authors_network_percent": network,
    }


def _simulated(
    fitted_at: tuple[int, ...], amplitude: int, effects: tuple[str, ...] = ()
) -> dict[int, Array]:
    """Each realisation, simulated by the model of the fold that holds it out."""
    return {
        k: predicted(identified(fitted_at, fold, effects, STATES), amplitude, k)
        for fold in FOLDS
        for k in fold
    }


def _mean(simulated: dict[int, Array], amplitude: int) -> float:
    """Error in %, mean over the realisations."""
    return float(np.mean([percent(squares(one, amplitude, k)) for k, one in simulated.items()]))
