"""How many poles and zeros the default plant's frequency record supports."""

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.core.identification.alternating import REFERENCE_GAIN, AxisRecord, response_to
from afm_scan_ros.core.identification.drives.excitation import frequency_plan
from afm_scan_ros.core.identification.vibration.rational_fit import PAPER
from afm_scan_ros.core.identification.vibration.structure import (
    OrderChoice,
    OrderTrial,
    choose_order,
)
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "axis": ("axis", ""),
    "order": ("order", ""),
    "misfit_percent": ("model minus response, % rms", ".4f"),
    "chi_squared": ("chi squared over degrees of freedom", ".2f"),
    "criterion": ("criterion, less the least", ".1f"),
    "verdict": ("", ""),
}


def measure() -> Table:
    """Fit each order to the response of the default plant, with its model's own hysteresis."""
    recording = record(frequency_plan(), default_plant(), SEED)
    rows: list[Row] = []
    for axis in AXES:
        choice = order_choice(default_model().axis(axis), AxisRecord.of(recording, axis))
        least = min(trial.criterion(choice.dispersion) for trial in choice.trials)
        rows += [
            {
                "axis": axis,
                "order": str(trial.order),
                "misfit_percent": 100.0 * trial.misfit,
                "chi_squared": trial.chi_squared / trial.freedom,
                "criterion": trial.criterion(choice.dispersion) - least,
                "verdict": ", ".join(verdicts(trial, choice)),
            }
            for trial in choice.trials
        ]
    return Table("order", "Order of the vibration model, by Schwarz's criterion", COLUMNS, rows)


def order_choice(model: AxisModel, frequency: AxisRecord) -> OrderChoice:
    """Try the orders on the response of a frequency record, F taken from the model."""
    waves = frequency.freed_of(model.creep)
    response = response_to(model.hysteresis.operator(), waves).seen()
    return choose_order(response, frequency.sample_period, REFERENCE_GAIN)


def verdicts(trial: OrderTrial, choice: OrderChoice) -> list[str]:
    """Which choices an order tried was."""
    choices = {
        "chosen": trial is choice.best,
        "the paper's": trial.order == PAPER,
        "has a mode that the band does not show": not trial.determined,
    }
    return [text for text, holds in choices.items() if holds]
