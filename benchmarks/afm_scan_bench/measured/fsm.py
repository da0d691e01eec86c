"""How well a linear model simulates a fine steering mirror that was measured by others."""

import numpy as np

from afm_scan_bench.measured.mirror.figure import response_figure
from afm_scan_bench.measured.mirror.fits import (
    AMPLITUDES,
    ORDER,
    REALISATIONS,
    channel_errors,
    fitted,
    fitted_to_all,
    measured,
    nonlinear_share,
    percent,
    period_noise,
)
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
    models = [fitted(amplitude, k) for k in REALISATIONS]
    errors = [channel_errors(models[k], amplitude, k) for k in REALISATIONS]
    each = [percent(error) for error in errors]
    channels = [np.mean([percent(error[:, [k]]) for error in errors]) for k in range(3)]
    of_all = [percent(channel_errors(fitted_to_all(k), amplitude, k)) for k in REALISATIONS]
    noise = [period_noise(amplitude, k) for k in REALISATIONS]
    return {
        "amplitude_mv": amplitude,
        "states": models[0].order,
        "error_percent": float(np.mean(each)),
        "worst_percent": max(each),
        **{f"channel_{k}_percent": float(channels[k - 1]) for k in (1, 2, 3)},
        **{f"realisation_{k}_percent": each[k] for k in REALISATIONS},
        "noise_percent": float(np.mean([100.0 * share.relative for share in noise])),
        "nonlinear_percent": 100.0 * nonlinear_share(amplitude),
        "authors_percent": AUTHORS[amplitude][0],
        "of_all_percent": float(np.mean(of_all)),
        "authors_of_all_percent": AUTHORS[amplitude][1],
        "stepped_from_rest_percent": stepped_from_rest(amplitude),
    }


def stepped_from_rest(amplitude: int) -> float:
    """Second period stepped in time, from rest, less the steady state: rms, in % of its rms."""
    drive = measured(amplitude).drive[:, :, 0].mean(axis=2)
    model = fitted(amplitude, 0)
    steady = model.steady_state(drive)
    _, state = model.simulate(drive)
    stepped, _ = model.simulate(drive, state)
    return float(100.0 * np.linalg.norm(stepped - steady) / np.linalg.norm(steady))
