"""The stream of inverses: any cut gives the same drive, and limits are named with their sample."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, Added, InverseSettings
from afm_scan_ros.core.prediction import predict
from afm_scan_ros.core.scanner import compensator
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.share import share_directory

PERIOD = 5e-5
MODEL = load_model(Path(share_directory() / "config/model.yaml"))
TOTAL = 1200
WAVE = 3e-6 * np.sin(np.linspace(0.0, np.pi, TOTAL)) ** 2


def compensation(voltage: float = 5.0, slew: float = 2e5) -> Compensation:
    return Compensation(MODEL, PERIOD, INVERSES, InverseSettings(), DriveLimits(voltage, slew))


LONG = InverseSettings(preview=0.03)
"""Longer than either axis' inverse needs, which do not need the same."""
LOOKS_FAR = Compensation(MODEL, PERIOD, INVERSES, LONG, DriveLimits(5.0, 2e5))


def run(under: Compensation, x: np.ndarray, y: np.ndarray, edges: list[int]) -> list[Trace]:
    progress, drives = under.at_rest(), []
    for a, b in pairwise(edges):
        progress, drive = under.invert(progress, Trace(a, PERIOD, x[a:b], y[a:b]))
        drives.append(drive)
    return [*drives, under.finish(progress)]


COMPENSATION = compensation()
(WHOLE_BUT_OWED, OWED) = run(COMPENSATION, WAVE, -WAVE, [0, TOTAL])


@given(st.sets(st.integers(1, TOTAL - 1), max_size=8))
@settings(deadline=None, max_examples=20)
def test_blocks_do_not_change_the_drive(inner: set[int]) -> None:
    drives = run(COMPENSATION, WAVE, -WAVE, [0, *sorted(inner), TOTAL])
    joined = np.concatenate([drive.x for drive in drives])
    assert joined == pytest.approx(np.append(WHOLE_BUT_OWED.x, OWED.x), abs=1e-9)
    sizes = np.cumsum([0, *(len(drive.x) for drive in drives)])
    assert [drive.first_sample for drive in drives] == list(sizes[:-1])
    assert sizes[-1] == TOTAL


@given(st.sets(st.integers(1, TOTAL - 1), max_size=8))
@settings(deadline=None, max_examples=20)
def test_axes_that_look_ahead_unequally_far_are_driven_together(inner: set[int]) -> None:
    drives = run(LOOKS_FAR, WAVE, -WAVE, [0, *sorted(inner), TOTAL])
    assert [len(drive.x) for drive in drives] == [len(drive.y) for drive in drives]
    whole = LOOKS_FAR.whole(Trace(0, PERIOD, WAVE, -WAVE))
    for axis in AXES:
        joined = np.concatenate([drive.axis(axis) for drive in drives])
        assert joined == pytest.approx(whole.axis(axis), abs=1e-9)
        assert len(joined) == TOTAL


@given(st.sets(st.integers(1, TOTAL - 1), max_size=8))
@settings(deadline=None, max_examples=20)
def test_an_axis_that_alone_has_a_play_is_waited_for(inner: set[int]) -> None:
    """Its inverse looks ahead before that of vibration does; each axis' cascade knows no other."""
    play = Added("backlash", "", (5e-8,))
    model = evolve(MODEL, y=evolve(MODEL.y, added=(play,)))
    under = Compensation(model, PERIOD, INVERSES, InverseSettings(), DriveLimits(5.0, 2e5))
    drives = run(under, WAVE, -WAVE, [0, *sorted(inner), TOTAL])
    for axis, target in (("x", WAVE), ("y", -WAVE)):
        alone = compensator(model.axis(axis), PERIOD, INVERSES, InverseSettings())
        state, first = alone.invert(alone.inverse_at_rest(), target)
        expected = np.concatenate((first, alone.finish(state)))
        joined = np.concatenate([drive.axis(axis) for drive in drives])
        assert joined == pytest.approx(expected, abs=1e-9)


@given(st.sets(st.integers(1, TOTAL - 1), max_size=8))
@settings(deadline=None, max_examples=5)
def test_what_acts_behind_the_coupling_is_undone_before_it(inner: set[int]) -> None:
    """The inverse takes the axes apart where the prediction puts them together."""
    added = (Added("cross_coupling", "static", (0.1,)), Added("static_nonlinearity", "", (2e3, 0)))
    model = evolve(MODEL, x=evolve(MODEL.x, added=added), y=evolve(MODEL.y, added=added))
    under = Compensation(model, PERIOD, INVERSES, InverseSettings(), DriveLimits(5.0, 2e5))
    drives = run(under, WAVE, 2.0 * WAVE, [0, *sorted(inner), TOTAL])
    joined = (np.concatenate([drive.axis(axis) for drive in drives]) for axis in AXES)
    found = predict(model, Trace(0, PERIOD, *joined))
    healthy = predict(MODEL, COMPENSATION.whole(Trace(0, PERIOD, WAVE, 2.0 * WAVE)))
    assert np.abs(found.x - healthy.x).max() < 1e-3 * WAVE.max()
    assert np.abs(found.y - healthy.y).max() < 1e-3 * WAVE.max()


def test_whole_is_the_blocks_together() -> None:
    drive = COMPENSATION.whole(Trace(0, PERIOD, WAVE, -WAVE))
    for axis in AXES:
        parts = (WHOLE_BUT_OWED.axis(axis), OWED.axis(axis))
        assert np.array_equal(drive.axis(axis), np.concatenate(parts))


def test_the_identified_range_is_named_with_sample_and_axis() -> None:
    with pytest.raises(ScanError, match=r"^sample \d+, axis y: .* V is beyond the ident") as caught:
        run(COMPENSATION, WAVE, 30.0 * WAVE, [0, 400, 800, TOTAL])
    sample = int(str(caught.value).split()[1].rstrip(","))
    assert 30.0 * WAVE[sample] > 10e-6  # where the target is large, not where the block begins


def test_the_voltage_limit_is_named_with_sample_axis_and_value() -> None:
    peak = np.abs(WHOLE_BUT_OWED.x).max()
    low = compensation(voltage=peak / 2)
    with pytest.raises(ScanError, match=r"sample \d+, axis x: drive \[V\] = "):
        run(low, WAVE, np.zeros(TOTAL), [0, 300, TOTAL])
