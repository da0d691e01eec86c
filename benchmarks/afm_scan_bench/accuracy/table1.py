"""The paper's Table 1 beside ours: how far creep of each order misses five minutes after a step.

As in the paper, each order is fitted to all of the record (Eqs. 2, 3). Beside it stands how each
predicts the last quarter from the rest, by which the order is chosen. The paper's sensor had some
50 nm of noise, the simulated one has 2 nm; sensor volts are of 8 µm each, an assumption.
"""

from collections.abc import Iterator

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import SEED, default_plant
from afm_scan_ros.core.effects.vibration import SENSOR_SENSITIVITY
from afm_scan_ros.core.identification.creep.record import CreepRecord, creep_record
from afm_scan_ros.core.identification.creep.series import choose, refine, try_orders
from afm_scan_ros.core.identification.drives.excitation import creep_plan
from afm_scan_ros.core.identification.records.recording import misfit
from afm_scan_ros.report.table import Row, Table

FIVE_MINUTES = 300.0
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
    seen = record(plan, default_plant(), SEED)
    rows = list(_rows(creep_record(*seen.signals("x"), plan.sample_period)))
    title = "Table 1: error of predicted creep over five minutes, by order"
    return Table("table1", title, COLUMNS, rows)


def _rows(seen: CreepRecord) -> Iterator[Row]:
    tried, averaged = try_orders(seen, max(PAPER)), seen.averaged()
    chosen = choose(tried)
    for each in tried:
        whole = misfit(seen.displacement - refine(averaged, each.series).predict(seen))
        sigma, maximum = PAPER[each.order]
        yield {
            "order": each.order,
            "paper_sigma_mv": sigma,
            "paper_maximum_mv": maximum,
            "sigma_mv": 1e3 * whole.sigma / SENSOR_SENSITIVITY,
            "maximum_mv": 1e3 * whole.maximum / SENSOR_SENSITIVITY,
            "sigma_nm": 1e9 * whole.sigma,
            "maximum_nm": 1e9 * whole.maximum,
            "held_out_nm": 1e9 * each.held_out.sigma,
            "chosen": "yes" if each is chosen else "",
        }
