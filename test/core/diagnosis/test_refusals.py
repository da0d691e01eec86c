"""A record is refused as of another scanner where the page of the constants says, not before."""

from contextlib import AbstractContextManager, nullcontext

import numpy as np
import pytest
from attrs import evolve
from scipy.signal import sawtooth

from afm_scan_ros.core.diagnosis.cautions import refuse_mismatch, single_rate_band
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import ModelDiscrepancy, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scanner import predict
from afm_scan_ros.core.types import Array, Trace
from helpers.in_process import default_model

PERIOD = 1e-4
TIME = PERIOD * np.arange(40_000)
ALONE = ScannerModel(x=default_model().x)


def refusal(expected: bool) -> AbstractContextManager[object]:  # noqa: FBT001 - a parameter
    return pytest.raises(InputError) if expected else nullcontext()


def driven(size: float) -> Trace:
    """Triangles of a size (V) at 1 Hz."""
    drive = size * np.asarray(sawtooth(2.0 * np.pi * (TIME + 0.25), 0.5))
    return Trace(0, PERIOD, drive, 0.0 * drive)


DRIVE = driven(2.0)


def predicted(drive: Trace = DRIVE, model: ScannerModel = ALONE) -> Array:
    moved = predict(model, drive).x
    return np.asarray(moved - moved.mean())


def check(measured: Array, drive: Trace = DRIVE, model: ScannerModel = ALONE) -> None:
    seen = Trace(0, PERIOD, measured, 0.0 * measured)
    refuse_mismatch(model, Record.of_traces("record", drive, seen, axes=("x",)))


@pytest.mark.parametrize(
    ("gain", "refused"), [(0.4, True), (0.6, False), (1.7, False), (2.3, True)]
)
def test_gains_in_one_unit_differ_by_no_more_than_two(gain: float, refused: bool) -> None:  # noqa: FBT001 - a parameter
    with refusal(refused):
        check(gain * predicted())


def correlated(share: float) -> Array:
    """Motion of this correlation with that predicted, at every delay at most."""
    moved = predicted()
    other = np.sin(2.0 * np.pi * 7.5 * TIME)
    other -= moved * (other @ moved) / (moved @ moved)
    other *= np.linalg.norm(moved) / np.linalg.norm(other)
    return np.asarray(share * moved + np.sqrt(1.0 - share**2) * other)


@pytest.mark.parametrize(("share", "refused"), [(0.6, True), (0.78, False)])
def test_motion_of_another_shape_correlates_by_seven_tenths(share: float, refused: bool) -> None:  # noqa: FBT001 - a parameter
    with refusal(refused):
        check(correlated(share))


@pytest.mark.parametrize(("share", "refused"), [(0.98, True), (0.9, False)])
def test_small_motion_of_one_shape_is_in_another_unit(share: float, refused: bool) -> None:  # noqa: FBT001 - a parameter
    """Of a correlation of 95 % on it is of one shape."""
    with refusal(refused):
        check(0.3 * correlated(share))


def loops_times(factor: float, moved: Array) -> Array:
    """Motion whose loops are so many times as wide."""
    line = DRIVE.x * (DRIVE.x @ moved) / (DRIVE.x @ DRIVE.x)
    return np.asarray(line + factor * (moved - line))


@pytest.mark.parametrize(("factor", "refused"), [(-0.35, False), (-0.7, True)])
def test_loops_that_go_half_as_far_backward_are_of_exchanged_columns(
    factor: float,
    refused: bool,  # noqa: FBT001 - a parameter
) -> None:
    with refusal(refused):
        check(loops_times(factor, predicted()))


def area(moved: Array) -> float:
    """Area of the loops, of the rectangle that holds them."""
    return -float(moved @ np.gradient(DRIVE.x)) / float(np.ptp(DRIVE.x) * np.ptp(moved))


@pytest.mark.parametrize(("share", "refused"), [(0.007, False), (0.015, True)])
def test_loops_of_a_hundredth_of_their_rectangle_show_their_sense(
    share: float,
    refused: bool,  # noqa: FBT001 - a parameter
) -> None:
    base = ALONE.axis("x")
    base = evolve(base, creep=evolve(base.creep, gains=1e-9 * np.array(base.creep.gains)))
    narrow = 0.1
    for _ in range(6):
        forward = base.hysteresis.forward.with_share(narrow)
        model = ScannerModel(x=evolve(base, hysteresis=evolve(base.hysteresis, forward=forward)))
        narrow *= share / area(predicted(model=model))
    with refusal(refused):
        check(loops_times(-1.0, predicted(model=model)), model=model)


@pytest.mark.parametrize(("gain", "refused"), [(70.0, False), (140.0, True)])
def test_a_record_that_hardly_moves_contradicts_by_a_hundred_times(
    gain: float,
    refused: bool,  # noqa: FBT001 - a parameter
) -> None:
    weak = driven(0.005)
    with refusal(refused):
        check(gain * predicted(weak), weak)


@pytest.mark.parametrize(("highest", "single"), [(70.0, True), (140.0, False)])
def test_several_rates_differ_by_ten_times(highest: float, single: bool) -> None:  # noqa: FBT001 - a parameter
    bands = (1.0, 10.0, highest, 1000.0)
    known = ModelDiscrepancy("record", bands, (0.0,) * 3, (0.0,) * 3, (1e-6, 1e-6, 0.0))
    assert (single_rate_band([known]) is not None) == single
