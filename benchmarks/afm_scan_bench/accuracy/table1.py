"""The paper's Table 1 beside ours: how far creep of each order misses five minutes after a step.

As in the paper, each order is fitted to all of the record (Eqs. 2, 3). Beside it stands how each
predicts the last quarter from the rest: the least order is chosen whose error there is as small as
any. The paper's sensor had some 50 nm of noise, the simulated one has 2 nm; sensor volts are of
8 µm each, an assumption.

The level and the gains follow from the time constants by linear least squares.
"""

from collections.abc import Iterator

import numpy as np
from scipy.optimize import least_squares

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import SEED, default_plant
from afm_scan_ros.core.effects.vibration import SENSOR_SENSITIVITY
from afm_scan_ros.core.identification.drives.excitation import creep_plan
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

FIVE_MINUTES = 300.0
SETTLING = 0.3
"""Seconds after the step in which the vibration dies."""
HELD_OUT = 0.25
"""Share of the record, its end, that is held out."""
BOUNDS = 0.1, 100.0 * FIVE_MINUTES
"""Of time constants, s."""
BEGUN = np.geomspace(1.0, FIVE_MINUTES, 12)
"""Time constants (s) of which one more element begins at the best."""
ALIKE = 1.02
"""Ratio of errors up to which they count as equal."""
PAPER = {1: (7.29, 46.8), 2: (6.89, 26.2), 3: (6.52, 23.1), 4: (6.53, 23.1), 5: (6.52, 22.4)}
"""Order → standard deviation and maximum of the error in mV: Table 1."""

COLUMNS = {
    "order": ("order", "d"),
    "paper_sigma_mv": ("paper sigma, mV", ".2f"),
    "paper_maximum_mv": ("max, mV", ".1f"),
    "sigma_mv": ("ours sigma, mV", ".2f"),
    "maximum_mv": ("max, mV", ".1f"),
    "sigma_nm": ("sigma, nm", ".2f"),
    "maximum_nm": ("max, nm", ".1f"),
    "held_out_nm": ("held out, nm", ".2f"),
    "chosen": ("pick", ""),
}


def measure() -> Table:
    """Fit creep of orders 1 to 5 to a step of the default plant's x, held for five minutes."""
    plan = creep_plan((FIVE_MINUTES,))
    drive, moved = record(plan, default_plant(), SEED).signals("x")
    time = plan.sample_period * (np.arange(len(drive)) - np.argmax(drive == drive.max()))
    held = (time > SETTLING) & (drive == drive.max())
    rows = list(_rows(time[held], moved[held]))
    title = "Table 1: error of predicted creep over five minutes, by order"
    return Table("table1", title, COLUMNS, rows)


def _rows(time: Array, moved: Array) -> Iterator[Row]:
    series = list(_series(time, moved))
    best = min(held_out for _, _, held_out in series)
    chosen = min(order for order, _, held_out in series if held_out < ALIKE * best)
    for order, constants, held_out in series:
        whole = misfit(left(time, moved, refined(time, moved, constants)))
        sigma, maximum = PAPER[order]
        yield {
            "order": order,
            "paper_sigma_mv": sigma,
            "paper_maximum_mv": maximum,
            "sigma_mv": 1e3 * whole.sigma / SENSOR_SENSITIVITY,
            "maximum_mv": 1e3 * whole.maximum / SENSOR_SENSITIVITY,
            "sigma_nm": 1e9 * whole.sigma,
            "maximum_nm": 1e9 * whole.maximum,
            "held_out_nm": 1e9 * held_out,
            "chosen": "yes" if order == chosen else "",
        }


def _series(time: Array, moved: Array) -> Iterator[tuple[int, Array, float]]:
    """Orders, their time constants (s) and their standard deviations (m) of what is held out."""
    fitting, constants = time < (1.0 - HELD_OUT) * time[-1], np.empty(0)
    given = time[fitting], moved[fitting]
    for order in PAPER:
        begun = (np.append(constants, each) for each in BEGUN)
        start = min(begun, key=lambda each: float(np.linalg.norm(left(*given, each))))
        constants = refined(*given, start)
        error = moved - columns(time, constants) @ weights_of(*given, constants)
        yield order, constants, misfit(error[~fitting]).sigma


def refined(time: Array, moved: Array, constants: Array) -> Array:
    """Time constants (s) that leave least, begun at others."""
    scale = np.linalg.norm(left(time, moved, constants))
    found = least_squares(
        lambda logs: left(time, moved, np.exp(logs)) / scale,
        np.log(constants),
        bounds=np.log(BOUNDS),
    )
    return np.asarray(np.exp(found.x))


def left(time: Array, moved: Array, constants: Array) -> Array:
    """What a series of these time constants leaves of a displacement (m), (n,)."""
    return moved - columns(time, constants) @ weights_of(time, moved, constants)


def weights_of(time: Array, moved: Array, constants: Array) -> Array:
    """Level at the step and growth by each element, m."""
    return np.asarray(np.linalg.lstsq(columns(time, constants), moved, rcond=None)[0])


def columns(time: Array, constants: Array) -> Array:
    """Unit responses of the spring and of each element at times (s) since the step."""
    lagged = -np.expm1(-time[:, np.newaxis] / constants)
    return np.column_stack([np.ones_like(time), lagged])
