"""How well a linear model simulates a fine steering mirror that was measured by others."""

import numpy as np

from afm_scan_bench.measured.mirror.figure import ORDER, response_figure
from afm_scan_bench.measured.mirror.recordings import (
    AMPLITUDES,
    REALISATIONS,
    SHAPE,
    identified,
    percent,
    period_noise,
    predicted,
    spectra,
    squares,
)
from afm_scan_bench.measured.mirror.response_matrix import response_matrix
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

AUTHORS = {100: (8.38, 18.61), 200: (7.95, 6.61), 300: (5.63, 16.28)}
"""The authors' rms errors in %, on test realisations of theirs: model of one amplitude, of all."""

COLUMNS = {
    "amplitude_mv": ("mV", "d"),
    "error_percent": ("error", ".2f"),
    "worst_percent": ("worst", ".2f"),
    "channel_1_percent": ("y1", ".2f"),
    "channel_2_percent": ("y2", ".2f"),
    "channel_3_percent": ("y3", ".2f"),
    "noise_percent": ("noise", ".2f"),
    "authors_percent": ("authors", ".2f"),
    "of_all_percent": ("joint", ".2f"),
    "authors_of_all_percent": ("authors", ".2f"),
}
TITLE = (
    "Fine steering mirror (Floren et al., ISMA-USD 2024, pp. 2042-2052, CC BY 4.0)\n"
    "Simulation error on the realisation left out, rms in % of the output's rms,\n"
    f"mean over six; {ORDER} states; joint: one model of all amplitudes; authors:\n"
    "their baselines of as many states, on their test realisations"
)


def measure() -> Table:
    """Simulate the steady state of each realisation by models that were fitted to the others."""
    rows = [_row(amplitude) for amplitude in AMPLITUDES]
    return Table("fsm", TITLE, COLUMNS, rows, picture=response_figure)


def _row(amplitude: int) -> Row:
    errors = [_errors((amplitude,), amplitude, k) for k in REALISATIONS]
    each = [percent(error) for error in errors]
    channels = [np.mean([percent(error[:, [k]]) for error in errors]) for k in range(3)]
    of_all = [percent(_errors(AMPLITUDES, amplitude, k)) for k in REALISATIONS]
    noise = [period_noise(amplitude, k) for k in REALISATIONS]
    return {
        "amplitude_mv": amplitude,
        "states": ORDER,
        "error_percent": float(np.mean(each)),
        "worst_percent": max(each),
        **{f"channel_{k}_percent": float(channels[k - 1]) for k in (1, 2, 3)},
        **{f"realisation_{k}_percent": each[k] for k in REALISATIONS},
        "noise_percent": float(np.mean([100.0 * share.relative for share in noise])),
        "nonlinear_percent": 100.0 * nonlinear_share(amplitude),
        "authors_percent": AUTHORS[amplitude][0],
        "of_all_percent": float(np.mean(of_all)),
        "authors_of_all_percent": AUTHORS[amplitude][1],
    }


def _errors(fitted_to: tuple[int, ...], amplitude: int, left_out: int) -> Array:
    model = identified(fitted_to, (left_out,), states=ORDER)
    return squares(predicted(model, amplitude, left_out), amplitude, left_out)


def nonlinear_share(amplitude: int) -> float:
    """Rms of what in one response differs between realisations beyond noise, over its rms."""
    found = response_matrix(spectra(amplitude))
    sets = len(REALISATIONS) // SHAPE[1]
    nonlinear, whole = (np.linalg.norm(part) for part in (found.nonlinear, found.response))
    return float(np.sqrt(sets) * nonlinear / whole)
