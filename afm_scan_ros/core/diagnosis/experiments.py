"""Experiments by how far apart two extended models foretell them: the farthest tells most.

As Atkinson and Fedorov design experiments to discriminate between two models (Biometrika 62, 1975),
each as it was fitted. Units are those of a misfit, floors squared.
"""

import numpy as np

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.effects.hysteresis.everett import BeyondRangeError
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.drives.experiments import EXPERIMENTS
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.prediction import predict


def rank_experiments(axis: str, model: ScannerModel, one: Chain, other: Chain) -> list[str]:
    """Names of the experiments, those first in which two chains of an axis differ most."""
    return sorted(
        EXPERIMENTS,
        key=lambda name: expected_difference(name, axis, model, one, other),
        reverse=True,
    )


def expected_difference(
    name: str, axis: str, model: ScannerModel, one: Chain, other: Chain
) -> float:
    """Mean square, in floors, by which two chains foretell an experiment differently.

    None at all where the drive leaves the range that the model was identified in.
    """
    plan = EXPERIMENTS[name].plan()
    drive = excitation_block(plan, 0, plan.total_samples)
    try:
        seen = evidence_of(axis, model, Observation(name, drive, predict(model, drive)))
        return float(
            np.mean((seen.normalised_residual(one) - seen.normalised_residual(other)) ** 2)
        )
    except BeyondRangeError:
        return 0.0
