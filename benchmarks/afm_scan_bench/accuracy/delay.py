"""The delay found in a frequency record of the default plant whose samples are delayed.

A rational model of the same record hardly shows the delay: its misfit stands beside.
"""

from afm_scan_bench.in_process import record
from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.core.identification.alternating import (
    REFERENCE_GAIN,
    AxisRecord,
    response_to,
)
from afm_scan_ros.core.identification.drives.excitation import frequency_plan
from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.structure import fit_chosen, record_delay
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.table import Row, Table

DELAYS = (0.0, 5e-6, 20e-6, 100e-6, 400e-6, 2e-3)
MICRO = 1e6
COLUMNS = {
    "axis": ("axis", ""),
    "delay_us": ("late by, µs", "g"),
    "found_us": ("found, µs", ".2f"),
    "lowest_us": ("at least, µs", ".2f"),
    "highest_us": ("at most, µs", ".2f"),
    "misfit_percent": ("misfit, %", ".3f"),
    "rational_percent": ("without a delay, %", ".3f"),
}


def measure() -> Table:
    """Delay the record of each axis, and find the delay."""
    recording = record(frequency_plan(), default_plant(), SEED)
    rows: list[Row] = []
    for axis in AXES:
        model = default_model().axis(axis)
        waves = AxisRecord.of(recording, axis).freed_of(model.creep)
        response = response_to(model.hysteresis.operator(), waves)
        rows += [{"axis": axis, **found(response, waves.sample_period, late)} for late in DELAYS]
    return Table("delay", "Delay found of a frequency record that is late", COLUMNS, rows)


def found(due: FrequencyResponse, sample_period: float, late: float) -> Row:
    """What is found of a response (m/V) that is late by so many s."""
    measured = due.advanced(-late)
    fit = fit_chosen(measured.seen(), sample_period, REFERENCE_GAIN)
    delay = record_delay(measured, sample_period, fit.resonance)
    low, high = delay.interval
    return {
        "delay_us": MICRO * late,
        "found_us": MICRO * delay.delay,
        "lowest_us": MICRO * low,
        "highest_us": MICRO * high,
        "misfit_percent": 100.0 * delay.misfit,
        "rational_percent": 100.0 * fit.misfit,
    }
