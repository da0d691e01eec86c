"""The stream of inverses: any cut gives the same drive, and limits are named with their sample."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, Added, InverseSettings, ScannerModel
from afm_scan_ros.core.scanner import Prediction, chain_of, predict
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model

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
        alone = chain_of(model.axis(axis)).compensator(PERIOD, INVERSES, InverseSettings())
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


def coupling(kind: str, *values: float) -> Added:
    return Added("cross_coupling", kind, values)


COUPLINGS = [
    (coupling("dynamic", 0.05, 300.0, 0.02),),
    (coupling("modal", -0.03, 0.05, 250.0, 0.05), coupling("arc", 1e3)),
    (coupling("coupled_mode", 0.02, 500.0, 0.05),),
    (coupling("static", 0.1), coupling("dynamic", 0.02, 90.0, 0.1)),
]
OTHERS = [
    (),
    (Added("static_nonlinearity", "", (2e3, 0.0)),),
    (Added("backlash", "", (5e-8,)), Added("input_lag", "", (3e-4,))),
    (Added("rate_dependent_hysteresis", "film", (2e-4,)), Added("drift", "", (1e-7, 30.0))),
    (Added("extra_resonance", "series_mode", (0.02, 1100.0, 0.03)), Added("delay", "", (1.3e-4,))),
    (Added("slow_creep", "", (0.05, 0.3)), Added("slew_limit", "", (2e3,))),
]


@given(
    to_x=st.sampled_from(COUPLINGS),
    to_y=st.sampled_from(COUPLINGS),
    x_added=st.sampled_from(OTHERS),
    y_added=st.sampled_from(OTHERS),
    cut=st.sets(st.integers(0, TOTAL), max_size=5),
)
@settings(deadline=None, max_examples=12)
def test_blocks_change_nothing_where_each_axis_adds_to_the_other(
    to_x: tuple[Added, ...],
    to_y: tuple[Added, ...],
    x_added: tuple[Added, ...],
    y_added: tuple[Added, ...],
    cut: set[int],
) -> None:
    """Of inverse and model, whatever else acts on either axis."""
    edges = [0, *sorted(cut), TOTAL]
    model = evolve(
        MODEL, x=evolve(MODEL.x, added=to_x + x_added), y=evolve(MODEL.y, added=to_y + y_added)
    )
    under = Compensation(model, PERIOD, INVERSES, LONG, DriveLimits(5.0, 2e5))
    whole, drives = (joined(run(under, WAVE, 2.0 * WAVE, e)) for e in ([0, TOTAL], edges))
    moved, expected = predicted(model, whole, edges), predict(model, whole)
    for axis in AXES:
        assert np.abs(drives.axis(axis) - whole.axis(axis)).max() <= 1e-9
        assert np.abs(moved.axis(axis) - expected.axis(axis)).max() <= 1e-9 * WAVE.max()


def test_resonances_of_both_axes_on_each_other_are_undone() -> None:
    """The model's motion under its own inverse is that of a healthy scanner, blocks cut or not."""
    model = evolve(MODEL, **{axis: evolve(MODEL.axis(axis), added=COUPLINGS[0]) for axis in AXES})
    under = Compensation(model, PERIOD, INVERSES, InverseSettings(), DriveLimits(5.0, 2e5))
    found = predict(model, under.whole(Trace(0, PERIOD, WAVE, 2.0 * WAVE)))
    healthy = predict(MODEL, COMPENSATION.whole(Trace(0, PERIOD, WAVE, 2.0 * WAVE)))
    for axis in AXES:
        assert np.abs(found.axis(axis) - healthy.axis(axis)).max() < 1e-3 * WAVE.max()


def joined(blocks: list[Trace]) -> Trace:
    x, y = (np.concatenate([block.axis(axis) for block in blocks]) for axis in AXES)
    return Trace(0, PERIOD, x, y)


def predicted(model: ScannerModel, drive: Trace, edges: list[int]) -> Trace:
    prediction = Prediction(model, PERIOD)
    state, moved = prediction.at_rest(), []
    for a, b in pairwise(edges):
        block = Trace(a, PERIOD, drive.x[a:b], drive.y[a:b])
        state, displacement = prediction.advance(state, block)
        moved.append(displacement)
    return joined(moved)


def test_an_inverse_that_grows_is_refused_before_the_first_block() -> None:
    added = [(coupling("dynamic", share, 300.0, 0.02),) for share in (0.05, -0.05)]
    x, y = (evolve(MODEL.axis(axis), added=each) for axis, each in zip(AXES, added, strict=True))
    model = evolve(MODEL, x=x, y=y)
    under = Compensation(model, PERIOD, INVERSES, InverseSettings(), DriveLimits(5.0, 2e5))
    with pytest.raises(InputError, match="inverse of the coupling of both axes is unstable"):
        under.at_rest()
    none = Compensation(model, PERIOD, (), InverseSettings(), DriveLimits(5.0, 2e5))
    assert np.isfinite(none.whole(Trace(0, PERIOD, WAVE, WAVE)).x).all()


def test_whole_is_the_blocks_together() -> None:
    drive = COMPENSATION.whole(Trace(0, PERIOD, WAVE, -WAVE))
    for axis in AXES:
        parts = (WHOLE_BUT_OWED.axis(axis), OWED.axis(axis))
        assert np.array_equal(drive.axis(axis), np.concatenate(parts))


def test_the_identified_range_is_named_with_sample_and_axis() -> None:
    with pytest.raises(ScanError, match=r"^sample \d+, axis y: .* V beyond the ident") as caught:
        run(COMPENSATION, WAVE, 30.0 * WAVE, [0, 400, 800, TOTAL])
    sample = int(str(caught.value).split()[1].rstrip(","))
    assert 30.0 * WAVE[sample] > 10e-6  # where the target is large, not where the block begins


def test_the_voltage_limit_is_named_with_sample_axis_and_value() -> None:
    peak = np.abs(WHOLE_BUT_OWED.x).max()
    low = compensation(voltage=peak / 2)
    with pytest.raises(ScanError, match=r"sample \d+, axis x: drive \[V\] = "):
        run(low, WAVE, np.zeros(TOTAL), [0, 300, TOTAL])
