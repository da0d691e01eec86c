"""A record of another scanner or in another unit is refused, however little the model predicts."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.diagnosis.cautions import refuse_mismatch
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import AxisModel, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.scanner import chain_of, predict
from afm_scan_ros.core.types import Trace
from helpers.in_process import ALL, default_model, scan

SPEC = ScanSpec(lines=3, samples_per_line=2000, preparation_cycles=5)
FACTORS = [1e-3, 1e-6, 1e-9]
"""Of what is in another unit: mV, µm and nm taken for V and m."""


@pytest.fixture(scope="module")
def healthy() -> Scan:
    return scan(SPEC, ALL)


def times(trace: Trace, factor: float) -> Trace:
    return evolve(trace, x=factor * trace.x, y=factor * trace.y)


def observed(drive: Trace, moved: Trace) -> Record:
    return Record.of_traces("a scan", drive, moved, SPEC)


def weaker(axis: AxisModel, factor: float) -> AxisModel:
    numerator = factor * np.array(axis.vibration.numerator)
    return evolve(axis, vibration=evolve(axis.vibration, numerator=tuple(numerator)))


def test_the_scanner_s_own_record_is_taken(healthy: Scan) -> None:
    refuse_mismatch(default_model(), observed(healthy.drive, healthy.measured))


@pytest.mark.parametrize("factor", FACTORS)
def test_a_drive_in_too_large_a_unit_is_refused(healthy: Scan, factor: float) -> None:
    record = observed(times(healthy.drive, factor), healthy.measured)
    with pytest.raises(InputError, match=r"a scan: axis x moves .* as far as the model says"):
        refuse_mismatch(default_model(), record)


@pytest.mark.parametrize("factor", FACTORS)
def test_a_model_in_too_large_a_unit_is_refused(healthy: Scan, factor: float) -> None:
    base = default_model()
    model = ScannerModel(x=base.x, y=weaker(base.y, factor))
    with pytest.raises(
        InputError, match=rf"a scan: axis y moves {1 / factor:.0e}".replace("+", r"\+")
    ):
        refuse_mismatch(model, observed(healthy.drive, healthy.measured))


@pytest.mark.parametrize("factor", [0.0, *FACTORS])
def test_a_displacement_in_too_large_a_unit_is_refused(healthy: Scan, factor: float) -> None:
    with pytest.raises(InputError, match="axis x moves"):
        refuse_mismatch(default_model(), observed(healthy.drive, times(healthy.measured, factor)))


@pytest.mark.parametrize("size", [0.0, 1e-9, 3e-8])
def test_a_scanner_that_hardly_moves_may_drift_farther(size: float) -> None:
    """What the drive does not account for is left to tracing, be it far larger."""
    time = 1e-4 * np.arange(20_000)
    lines, steps = size * np.abs(time * 5.0 % 2.0 - 1.0), size * np.floor(time * 5.0) / 10.0
    noise = np.random.default_rng(1).normal(0.0, 2e-9, (2, time.size))
    moved = 1e-6 * (1.0 - np.exp(-time)) + noise + np.stack((lines, steps))
    volts = Trace(0, 1e-4, 1e5 * lines, 1e5 * steps)
    refuse_mismatch(default_model(), observed(volts, Trace(0, 1e-4, *moved)))


def test_a_resonance_that_moved_makes_no_other_scanner() -> None:
    """A chirp through the resonance moves little like the model where this has moved by 8 %."""
    time = np.arange(40_000) / 20e3
    drive = Trace(0, 5e-5, *(0.1 * np.sin(np.pi * 450.0 * time**2 / time[-1]) for _ in range(2)))
    base = default_model()
    moved = evolve(base, x=evolve(base.x, vibration=lowered(base.x)))
    measured = predict(moved, drive)
    gain = float(predict(base, drive).x @ measured.x) / float(measured.x @ measured.x)
    assert gain < 0.5  # or the test shows nothing
    refuse_mismatch(base, Record.of_traces("a chirp", drive, measured))


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_slew_limit_makes_no_other_scanner(share: float) -> None:
    """Motion comes late and is far smaller where the drive is steeper than an amplifier can be."""
    cycle = np.interp(
        np.arange(20_000) % 1000 / 1000.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0]
    )
    drive = Trace(0, 5e-5, 3.0 * cycle, 3.0 * cycle)
    limited = evolve(drive, x=share * np.roll(3.0 * cycle, 150))
    measured = predict(default_model(), limited)
    refuse_mismatch(default_model(), Record.of_traces("a scan", drive, measured))


def test_another_axis_is_refused_at_any_delay(healthy: Scan) -> None:
    other = evolve(healthy.measured, x=healthy.measured.y)
    with pytest.raises(InputError, match=r"axis x moves unlike the model"):
        refuse_mismatch(default_model(), observed(healthy.drive, other))


def test_exchanged_columns_are_refused(healthy: Scan) -> None:
    """Volts for micrometres, as a table has them: the motion is as large, but ahead."""
    gain = float(np.ptp(healthy.measured.x) / np.ptp(healthy.drive.x))
    drive = times(healthy.measured, 1.0 / gain)
    moved = times(healthy.drive, gain)
    alone = ScannerModel(x=default_model().x)
    with pytest.raises(InputError, match=r"axis x goes round its loops backward: its drive and"):
        refuse_mismatch(alone, observed(drive, moved))


def lowered(axis: AxisModel) -> VibrationModel:
    """Vibration with its first resonance at 0.92 times its frequency."""
    shift = effect_type("parameter_shift").form("resonance")
    chain = shift.insert(chain_of(axis), np.array([0.92, 1.0]))
    return chain.model.vibration
