"""A drive is recognised from its shape alone, stretch by stretch."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.identification.records.kinds import recognised, stretches

TIME = np.arange(50_000) / 5e3
NOISE = np.random.default_rng(1).standard_normal(len(TIME))
DRIVES = {
    "rest": np.zeros(1000),
    "steps": np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, 40), 1000),
    "multisine": np.tile(NOISE[:5000], 6),
    "sweep": signal.chirp(TIME, 1.0, TIME[-1], 500.0, "log"),
    "noise": signal.lfilter(*signal.butter(4, 0.1), NOISE),
    "loops": TIME * np.sin(2.0 * np.pi * 3.0 * TIME),
    "scan": np.tile(np.interp(np.arange(1000.0), [0.0, 500.0, 1000.0], [-1.0, 1.0, -1.0]), 9),
}


@pytest.mark.parametrize("kind", DRIVES)
@pytest.mark.parametrize("size", [1e-3, -150.0])
def test_each_kind_is_recognised_whatever_its_size_and_sign(kind: str, size: float) -> None:
    found = stretches(size * DRIVES[kind])
    assert max(found, key=lambda stretch: stretch.samples).kind == kind


@pytest.mark.parametrize("kind", ["multisine", "sweep", "noise"])
@pytest.mark.parametrize("rests", [(3000, 60_000), (60_000, 3000)])
def test_a_drive_before_or_after_that_of_another_axis(kind: str, rests: tuple[int, int]) -> None:
    before, after = (np.zeros(rest) for rest in rests)
    drive = np.concatenate([before, DRIVES[kind], after])
    found = stretches(drive)
    assert [stretch.kind for stretch in found] == ["rest", kind, "rest"]
    assert found[1].samples == pytest.approx(len(DRIVES[kind]), abs=2)
    assert recognised(drive) == "frequency"


def test_a_sweep_of_few_samples_a_cycle() -> None:
    sweep = signal.chirp(TIME, 0.5, TIME[-1], 1200.0, "log", -90.0)
    assert [each.kind for each in stretches(sweep)] == ["sweep"]


@pytest.mark.parametrize("clock", [1, 4, 10])
def test_a_binary_sequence_excites_as_noise_does(clock: int) -> None:
    bits = 2.0 * signal.max_len_seq(13)[0] - 1.0
    drive = np.repeat(bits, clock)[:50_000]
    assert recognised(drive) == "frequency"
    square = np.repeat([0.0, 1.0] * 5, 5000)
    assert recognised(square) == "creep"


def test_stretches_leave_no_gap() -> None:
    drive = np.concatenate([DRIVES["steps"], DRIVES["loops"], DRIVES["rest"], DRIVES["noise"]])
    found = stretches(drive)
    assert [each.first for each in found] == [0, *(each.last for each in found[:-1])]
    assert found[-1].last == len(drive)
