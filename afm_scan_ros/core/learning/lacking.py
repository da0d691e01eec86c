"""What a model lacks, as a learned drive shows it."""

import numpy as np

from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.learning.loop import LearningScan, best_of
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.trajectory import phases
from afm_scan_ros.core.types import AXES


def observations(scans: list[LearningScan]) -> list[Observation]:
    """Return the first scan and the best one as records for a diagnosis."""
    chosen = {"first": scans[0], "learned": best_of(scans)}
    return [
        Observation(name, done.scan.drive, done.scan.measured, done.scan.spec)
        for name, done in chosen.items()
    ]


def lacking(model: ScannerModel, learned: LearningScan) -> dict[str, float]:
    """Rms (m) of each axis' displacement that a model lacks at the learned drive.

    It is the desired displacement, which the scanner follows, minus the one that the model
    predicts, without its mean, on all lines but the first.
    """
    scan = learned.scan
    predicted = predict(model, scan.drive)
    where = phases(scan.spec).lines
    lines = slice(where.start + scan.spec.samples_per_line, where.stop)
    missing = {n: scan.desired.axis(n)[lines] - predicted.axis(n)[lines] for n in AXES}
    return {name: float(np.std(each)) for name, each in missing.items()}
