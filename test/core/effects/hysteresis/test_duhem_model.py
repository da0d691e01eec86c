"""A whole model with a Duhem operator: prediction, compensation, other effects and a diagnosis."""

import numpy as np
import paper
import pytest
from attrs import evolve

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.diagnosis.discrepancy import error_between_levels
from afm_scan_ros.core.diagnosis.records import AxisSignals, InitialState, Playback
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, Added, AxisModel, InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import chain_of, forward
from afm_scan_ros.core.types import Trace

PERIOD = 5e-5
BASE = paper.axis()
HYSTERESIS = evolve(BASE.hysteresis, forward=paper.coleman_hodgdon())
AXIS = evolve(BASE, hysteresis=HYSTERESIS)
SETTINGS = InverseSettings(preview=0.1)
TARGET = 3.0 * AXIS.vibration.static_gain * np.sin(np.linspace(0.0, 3.0 * np.pi, 60_001)) ** 3


def compensation(model: AxisModel, voltage: float = 5.0) -> Compensation:
    limits = DriveLimits(voltage, 2e5)
    return Compensation(ScannerModel(model), PERIOD, INVERSES, SETTINGS, limits)


def trace(x: np.ndarray, first: int = 0) -> Trace:
    return Trace(first, PERIOD, x, np.zeros(len(x)))


def test_the_compensated_model_tracks() -> None:
    drive = compensation(AXIS).whole(trace(TARGET)).x
    cascade = forward(AXIS, PERIOD)
    moved = cascade.apply(cascade.at_rest(), drive)[1]
    assert np.abs(moved - TARGET).max() < 1e-3 * np.ptp(TARGET)


def test_any_blocks_give_the_same_drive() -> None:
    under = compensation(AXIS)
    progress, parts = under.at_rest(), []
    for first in range(0, len(TARGET), 7001):
        progress, drive = under.invert(progress, trace(TARGET[first : first + 7001], first))
        parts.append(drive.x)
    parts.append(under.finish(progress).x)
    whole = under.whole(trace(TARGET)).x
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=0.0, atol=1e-9)


def test_a_scan_beyond_the_range_is_refused_by_its_sample() -> None:
    with pytest.raises(ScanError, match=r"sample \d+, axis x: .* beyond the identified range"):
        compensation(AXIS).whole(trace(1.5 * TARGET))


def test_the_direct_inverse_stays_for_who_asks_for_it() -> None:
    settings = evolve(SETTINGS, hysteresis_inverse="direct")
    direct = Chain(AXIS).compensator(PERIOD, INVERSES, settings)
    plain = Chain(BASE).compensator(PERIOD, INVERSES, settings)
    wave = 0.1 * TARGET
    one, other = (each.invert(each.inverse_at_rest(), wave)[1] for each in (direct, plain))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("kind", ["", "film"])
def test_effects_on_plays_are_refused(kind: str) -> None:
    with pytest.raises(InputError, match="Duhem operator: it has no Everett surface"):
        chain_of(evolve(AXIS, added=(Added("rate_dependent_hysteresis", kind, (2e-4,)),)))


def test_its_memory_can_shift() -> None:
    form = effect_type("parameter_shift").form("hysteresis")
    chain = form.insert(Chain(AXIS), np.array([0.5]))
    assert chain.model.hysteresis.forward == HYSTERESIS.forward.with_share(0.5)


def test_an_excursion_before_the_record_is_played_back() -> None:
    """The diagnosis knows a state as a drive history, which ends at any (u, F)."""
    drive = 2.0 * np.sin(np.linspace(0.0, 6.0, 3000))
    history = InitialState((3.0,))
    cascade = forward(AXIS, PERIOD)
    both = cascade.apply(cascade.at_rest(), np.concatenate([history.path(), drive]))[1]
    view = AxisSignals("a record", PERIOD, drive, both[-3000:], np.zeros(3000))
    moved = Playback(view, history).displacement(Chain(AXIS))
    blank = Playback(view).displacement(Chain(AXIS))
    assert np.ptp(moved - blank) > 0.01 * np.ptp(blank)


def test_it_has_no_corners_between_levels() -> None:
    view = AxisSignals("a record", PERIOD, np.ones(10), np.ones(10), np.zeros(10))
    assert not error_between_levels(Playback(view), Chain(AXIS)).any()
