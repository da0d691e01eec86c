"""Ranks experiments by the predicted difference between two extended models.

Experiments that discriminate between two fitted models follow Atkinson and Fedorov (Biometrika 62,
1975). Differences are in units of the misfit, detection limits squared.
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
    """Names of the experiments, the largest difference between two chains first."""
    return sorted(
        EXPERIMENTS,
        key=lambda name: expected_difference(name, axis, model, one, other),
        reverse=True,
    )


def expected_difference(
    name: str, axis: str, model: ScannerModel, one: Chain, other: Chain
) -> float:
    """Mean square difference of two chains' predictions of an experiment, in detection limits.

    Zero where the drive leaves the range that the model was identified in.
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
