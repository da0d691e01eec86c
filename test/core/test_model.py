"""The cascades that follow from a model: forwards, and with each inverse switched."""

from itertools import combinations

import numpy as np
import paper
import pytest

from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    INVERSES,
    AxisModel,
    InverseSettings,
    ScannerModel,
)
from afm_scan_ros.core.scanner import chain_of, forward

PERIOD = 5e-5
SUBSETS = [s for n in range(len(INVERSES) + 1) for s in combinations(INVERSES, n)]


def compensated(chain: Cascade, axis: AxisModel, targets: np.ndarray) -> np.ndarray:
    """Displacement of the model's own scanner under the drive that the chain computes."""
    state, first = chain.invert(chain.inverse_at_rest(), targets)
    drive = np.concatenate((first, chain.finish(state)))
    model = forward(axis, PERIOD)
    return model.apply(model.at_rest(), drive)[1]


def rms_error(axis: AxisModel, inverses: tuple[str, ...]) -> float:
    """Rms over the range, for a slow target and a fast one after it."""
    height = 4.0 * axis.vibration.static_gain
    slow, fast = paper.smooth_target(2, 40_000, height), paper.smooth_target(5, 400, height)
    targets = np.concatenate((slow, fast))
    chain = chain_of(axis).compensator(PERIOD, inverses, InverseSettings())
    error = compensated(chain, axis, targets) - targets
    return float(np.sqrt(np.mean(error**2)) / np.ptp(targets))


def test_without_an_inverse_the_drive_is_one_gain(axis: AxisModel) -> None:
    chain = chain_of(axis).compensator(PERIOD, (), InverseSettings())
    targets = paper.smooth_target(3, 100, 1e-5)
    _, drive = chain.invert(chain.inverse_at_rest(), targets)
    gain = axis.hysteresis.forward.chord * axis.vibration.static_gain
    assert drive == pytest.approx(targets / gain)


def test_all_inverses_leave_a_perfect_model_no_error_to_speak_of(axis: AxisModel) -> None:
    assert rms_error(axis, INVERSES) < 1e-4


@pytest.mark.parametrize("inverses", [s for s in SUBSETS if len(s) < len(INVERSES)], ids=str)
def test_any_inverse_left_out_costs_error(axis: AxisModel, inverses: tuple[str, ...]) -> None:
    assert rms_error(axis, inverses) > 10.0 * rms_error(axis, INVERSES)


def test_the_direct_inverse_is_used_where_asked(axis: AxisModel) -> None:
    targets = paper.smooth_target(3, 2000, 4.0 * axis.vibration.static_gain)
    drives = []
    for kind in ("exact", "direct"):
        chain = chain_of(axis).compensator(
            PERIOD, ["hysteresis"], InverseSettings(hysteresis_inverse=kind)
        )
        drives.append(chain.invert(chain.inverse_at_rest(), targets)[1])
    assert np.abs(drives[0] - drives[1]).max() > 0.01


def test_an_unknown_inverse_is_refused_by_name(axis: AxisModel) -> None:
    with pytest.raises(InputError, match="'drift': choose among creep, hysteresis, vibration"):
        chain_of(axis).compensator(PERIOD, ["creep", "drift"], InverseSettings())


@pytest.mark.parametrize(
    "wrong",
    [
        {"hysteresis_inverse": "best"},
        {"preview": -1.0},
    ],
    ids=str,
)
def test_settings_out_of_range_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        InverseSettings(**wrong)


def test_axes_are_found_by_name(axis: AxisModel) -> None:
    other = AxisModel(axis.hysteresis, axis.vibration, paper.creep())
    model = ScannerModel(axis, other)
    assert model.axis("x") is axis
    assert model.axis("y") is other
