"""How exact the inverse hysteresis is on a drive that fitted nothing."""

import numpy as np

from afm_scan_ros.bench.scans import SEED, default_model, default_plant
from afm_scan_ros.bench.table import Row, Table
from afm_scan_ros.core.effects.hysteresis.direct import DirectInverse
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.identification.excitation import Waypoints, excitation_block
from afm_scan_ros.core.identification.recording import misfit
from afm_scan_ros.core.identification.turns import SLOW, AxisRecord
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.simulation.scanner import Piezoscanner

SAMPLE_RATE = 20e3
SPEED = 10.0  # V/s, as slow as the record that was fitted
BLEND = 0.02  # s
REVERSALS = 60
LIMIT = 3.8  # V, within the identified ±4 V
RANGE = 8.0  # V, the identified range that the errors are shares of

COLUMNS = {
    "axis": ("axis", ""),
    "inverse": ("inverse", ""),
    "sigma_v": ("sigma, V (Eq. 18)", ".4f"),
    "max_v": ("max, V (Eq. 19)", ".4f"),
    "sigma_percent": ("sigma, % of range", ".3f"),
    "max_percent": ("max, % of range", ".3f"),
}


def measure() -> Table:
    """Predict a fresh record's drive from its displacement: loops of random size and mean."""
    plan = fresh_plan()
    drive = excitation_block(plan, 0, plan.total_samples)
    measured, _ = Piezoscanner(default_plant(), plan.sample_period, SEED).advance(drive)
    rows: list[Row] = []
    for axis in AXES:
        record = AxisRecord(drive.axis(axis), measured.axis(axis), plan.sample_period)
        rows += [
            {"axis": axis, "inverse": name, **errors(predicted - record.drive)}
            for name, predicted in predictions(default_model().axis(axis), record).items()
        ]
    title = "Inverse hysteresis on a fresh record: drive predicted from displacement"
    return Table("hysteresis", title, COLUMNS, rows)


def fresh_plan() -> Waypoints:
    """Slow moves between random levels that shrink and grow again, from rest and back to it."""
    rng = np.random.default_rng(SEED)
    envelope = LIMIT * (0.55 + 0.45 * np.cos(np.linspace(0.0, 4.0 * np.pi, REVERSALS)))
    levels = np.concatenate([[0.0], envelope * rng.uniform(-1.0, 1.0, REVERSALS), [0.0]])
    seconds = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(levels)) / SPEED + BLEND)])
    samples = np.rint(seconds * SAMPLE_RATE)
    return Waypoints("fresh", 1.0 / SAMPLE_RATE, levels, samples, BLEND * SAMPLE_RATE)


def predictions(model: AxisModel, record: AxisRecord) -> dict[str, Array]:
    """Drive, V, that each inverse predicts from the record freed of creep and vibration."""
    rigid = record.freed_of(model.creep)
    slow = Vibration(model.vibration, record.sample_period, SLOW).inverse
    effective = slow.invert_whole(rigid.displacement)
    exact, direct = Preisach(model.hysteresis.forward), DirectInverse(model.hysteresis.direct)
    return {
        "exact": exact.invert(exact.inverse_at_rest(), effective)[1],
        "direct (the paper's)": direct.invert(direct.inverse_at_rest(), effective)[1],
    }


def errors(error: Array) -> dict[str, float]:
    """Figures of merit of a prediction, in V and in % of the identified range."""
    found = misfit(error)
    return {
        "sigma_v": found.sigma,
        "max_v": found.maximum,
        "sigma_percent": 100.0 * found.sigma / RANGE,
        "max_percent": 100.0 * found.maximum / RANGE,
    }
