"""How many poles and zeros the default plant's frequency record supports.

The plant has a mode beyond the band, so more poles than the paper's four predict held-out waves a
little better. They count for nothing, as the band shows neither frequency nor damping of that mode:
the default model has the paper's order, and the diagnosis can find the missing mode.
"""

from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.cli.in_process import record
from afm_scan_ros.core.identification.alternating import (
    HIGHEST,
    REFERENCE_GAIN,
    AxisRecord,
    strongest_waves,
)
from afm_scan_ros.core.identification.drives.excitation import frequency_plan
from afm_scan_ros.core.identification.vibration.order_selection import (
    OrderChoice,
    OrderTrial,
    choose_order,
)
from afm_scan_ros.core.identification.vibration.rational_fit import PAPER, Order
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.table import Row, Table

ORDERS = (Order(2, 1), Order(3, 2), PAPER, Order(6, 5))
COLUMNS = {
    "axis": ("axis", ""),
    "order": ("order", ""),
    "error_percent": ("error on held-out waves, % rms", ".4f"),
    "verdict": ("", ""),
}


def measure() -> Table:
    """Hold out each of the strongest waves in turn, with the default model's own hysteresis."""
    recording = record(frequency_plan(), default_plant(), SEED)
    rows: list[Row] = []
    for axis in AXES:
        choice = order_choice(default_model().axis(axis), AxisRecord.of(recording, axis))
        rows += [
            {
                "axis": axis,
                "order": str(trial.order),
                "error_percent": 100.0 * trial.error,
                "verdict": ", ".join(verdicts(trial, choice.chosen)),
            }
            for trial in choice.trials
        ]
    return Table("order", "Order of the vibration model, by waves held out", COLUMNS, rows)


def order_choice(model: AxisModel, frequency: AxisRecord) -> OrderChoice:
    """Try the orders on the strongest waves of a frequency record, F taken from the model."""
    waves = strongest_waves(model.hysteresis.operator(), frequency.freed_of(model.creep))
    return choose_order(waves, frequency.sample_period, REFERENCE_GAIN, HIGHEST, ORDERS)


def verdicts(trial: OrderTrial, chosen: Order) -> list[str]:
    """What is said of an order tried."""
    said = {
        "chosen by the criterion": trial.order == chosen,
        "of the default model (the paper's)": trial.order == PAPER,
        "has a mode that the band does not show": not trial.told,
    }
    return [words for words, holds in said.items() if holds]
