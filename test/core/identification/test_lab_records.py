"""What labs record is no damage: any drive, sign of it, range, sensor and sample rate."""

import os
from pathlib import Path

import numpy as np
import pytest
from attrs import frozen
from scipy.signal import chirp, cont2discrete, lfilter, max_len_seq

from afm_scan_ros.core.identification.records.recording import checked, problems
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, Trace

DATA = Path(os.environ.get("AFM_SCAN_DATA", Path(__file__).parents[4] / "shared/data"))
PERIOD = 1e-4
TIME = PERIOD * np.arange(20_000)


@frozen
class Stage:
    """A stage: slip elements of some share, then one resonance, then a sensor."""

    gain: float = 5e-6
    resonance: float = 400.0
    damping: float = 0.02
    share: float = 0.2
    noise: float = 2e-9
    bits: int | None = None
    offset: float = 0.0

    def moved(self, drive: Array, period: float) -> Array:
        """Displacement (m) under a drive (V), from rest where the drive begins."""
        widths = np.ptp(drive) * np.array([0.05, 0.1, 0.2, 0.3])
        slipped = np.mean([_slip(drive, width) for width in widths], axis=0)
        bent = (1.0 - self.share) * drive + self.share * slipped
        speed = 2.0 * np.pi * self.resonance
        system = [speed**2], [1.0, 2.0 * self.damping * speed, speed**2]
        above, below, _ = cont2discrete(system, period)
        moved = self.gain * (bent[0] + lfilter(above.ravel(), below, bent - bent[0]))
        moved += self.noise * np.random.default_rng(0).standard_normal(len(drive))
        step = 1.2 * np.ptp(moved) / 2**self.bits if self.bits else 0.0
        return self.offset + (step * np.round(moved / step) if step else moved)


def _slip(drive: Array, width: float) -> Array:
    place, places = drive[0], np.empty_like(drive)
    for k, volts in enumerate(drive):
        place = max(volts - width, min(volts + width, place))
        places[k] = place
    return places


def triangle(rate: float, time: Array = TIME) -> Array:
    return 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * rate * time))


def waves(highest: float) -> Array:
    """Multisines that follow each other without a pause, of several sizes."""
    rng, length = np.random.default_rng(2), 2000
    lines = np.zeros((4, length // 2 + 1), dtype=complex)
    count = int(highest * PERIOD * length)
    lines[:, 1:count] = np.exp(2j * np.pi * rng.random((4, count - 1)))
    periods = np.fft.irfft(lines, length)
    sizes = np.array([1.0, 1.0, 0.3, 2.0]) / np.abs(periods).max(axis=1)
    return np.concatenate(
        [np.tile(size * wave, 3) for size, wave in zip(sizes, periods, strict=True)]
    )


UNIPOLAR = 75.0 - 75.0 * np.cos(4.0 * np.pi * TIME)
HIGH = {"gain": 1e-7}
GROWING = 4.0 * np.linspace(0.1, 1.0, len(TIME)) * triangle(5.0)
SQUARE = 2.0 * np.sign(np.sin(6.0 * np.pi * TIME + 1e-9))
SLOW = 5e-3
SLOW_TIME = SLOW * np.arange(8000)
CASES: dict[str, tuple[float, Array, Stage]] = {
    "bipolar": (PERIOD, GROWING, Stage()),
    "0 to 150 V": (PERIOD, UNIPOLAR, Stage(**HIGH)),
    "0 to 150 V about the middle": (
        PERIOD,
        75.0 + 75.0 * triangle(5.0),
        Stage(**HIGH, offset=-96e-6),
    ),
    "below zero": (PERIOD, -UNIPOLAR, Stage(**HIGH)),
    "1.8 mm": (PERIOD, UNIPOLAR, Stage(gain=12e-6)),
    "8 bits": (PERIOD, GROWING, Stage(bits=8)),
    "10 bits without noise": (PERIOD, GROWING, Stage(bits=10, noise=0.0)),
    "steps at 8 bits": (PERIOD, SQUARE, Stage(bits=8)),
    "steps to 150 V": (PERIOD, np.repeat([0.0, 50.0, 150.0, 75.0, 0.0], 4000), Stage(**HIGH)),
    "multisines": (PERIOD, waves(1000.0), Stage()),
    "slow multisines": (PERIOD, waves(200.0), Stage(share=0.5)),
    "multisines of a light resonance": (
        PERIOD,
        waves(1000.0),
        Stage(resonance=820.0, damping=0.003),
    ),
    "multisines below a resonance": (PERIOD, waves(1000.0), Stage(resonance=3000.0, damping=0.01)),
    "multisines at 12 bits": (PERIOD, waves(1000.0), Stage(bits=12)),
    "random steps": (PERIOD, 2.0 * np.repeat(max_len_seq(10)[0] - 0.5, 20)[:20_000], Stage()),
    "noise": (PERIOD, np.random.default_rng(1).standard_normal(20_000), Stage()),
    "sweep": (PERIOD, chirp(TIME, 1.0, 2.0, 2000.0), Stage(damping=0.003)),
    "sawtooth": (PERIOD, 4.0 * ((5.0 * TIME) % 1.0), Stage()),
    "1 Hz at 200 Hz, wide loops": (
        SLOW,
        1.8 + 1.8 * np.sin(2.0 * np.pi * SLOW_TIME),
        Stage(gain=12e-6, share=0.5, noise=70e-9, resonance=80.0, offset=-3e-5),
    ),
    "0.05 Hz, wide loops": (
        SLOW,
        2.0 * np.sin(0.1 * np.pi * SLOW_TIME),
        Stage(share=0.5, resonance=80.0),
    ),
    "20 kHz": (2e-6, np.random.default_rng(1).standard_normal(20_000), Stage(resonance=20e3)),
}


def of_x(values: Array, period: float) -> Trace:
    return Trace(0, period, values, np.zeros(len(values)))


@pytest.mark.parametrize("case", CASES)
def test_a_good_record_is_none_the_worse_for_its_lab(case: str) -> None:
    period, drive, stage = CASES[case]
    found = problems(Record(drive, stage.moved(drive, period), period))
    assert list(found) == []


def test_samples_lost_between_multisines_are_found_all_the_same() -> None:
    drive = waves(1000.0)
    moved = Stage().moved(drive, PERIOD)
    lost = np.concatenate([moved[:7000], moved[7030:], moved[-30:]])
    message = list(problems(Record(drive, lost, PERIOD)))
    assert any("jumps, as if samples were lost" in each for each in message), message
    assert any("at sample 7000" in each for each in message), message


def test_a_recording_of_a_micromanipulator_is_none_the_worse() -> None:
    path = DATA / "piezo_micromanipulator/Model_Vi_Do.dat"
    if not path.exists():
        pytest.skip(f"measured data are not in {DATA}: set AFM_SCAN_DATA")
    table = np.loadtxt(path)
    assert list(problems(Record(table[:, 0], 1e-6 * table[:, 4], 5e-3))) == []


def test_an_axis_that_is_not_driven_is_left_out() -> None:
    drive = of_x(GROWING, PERIOD)
    moved = Trace(0, PERIOD, Stage().moved(GROWING, PERIOD), 1e-8 * np.sin(TIME))
    assert checked(Record.of_traces("loops", drive, moved)).axes == ("x",)


def test_the_zero_is_where_the_record_rests() -> None:
    drive = np.concatenate([np.zeros(500), GROWING])
    moved = Stage(offset=-96e-6).moved(drive, PERIOD)
    record = checked(Record(drive, moved, PERIOD))
    np.testing.assert_allclose(record.displacement[:, 0], moved - moved[:501].mean(), atol=1e-12)
