"""A disturbance reads by amplitude and phase, and what is not significant takes one row."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.diagnosis.result import Value
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.report.quantity import Harmonic, harmonic_rows

HUM = effect_type("periodic_disturbance").form("hum").parameters


def values(*pairs: tuple[float, float], half: float = 2.6e-9) -> list[Value]:
    """Cosine and sine of each harmonic, and 50 Hz where the form has it."""
    of = [number for pair in pairs for number in pair]
    of.insert(2, 50.0)
    halves = [1e-4 if p.unit == "Hz" else half for p in HUM]
    return [Value(*each) for each in zip(HUM[: len(of)], of, halves, strict=False)]


def test_harmonics_that_are_not_significant_take_one_row() -> None:
    weak = [(1.84e-10, 1.22e-10)] * 4
    rows = dict(harmonic_rows(values((-1.459e-7, 4.151e-7), (3.871e-7, 8e-9), *weak)))
    assert rows["amplitude"] == "440.0 ± 2.6 nm"
    assert rows["phase"].startswith("109.37 ± 0.34")
    assert rows["amplitude 2"].startswith("387.2 ± 2.6")
    assert rows["harmonics 3, 4, 5, 6"] == "not significant, 3.9 nm at most"
    assert list(rows) == [
        "frequency",
        "amplitude",
        "phase",
        "amplitude 2",
        "phase 2",
        "harmonics 3, 4, 5, 6",
    ]


@given(size=st.floats(1e-8, 1e-6), phase=st.floats(-180.0, 180.0))
def test_amplitude_and_phase_make_the_same_wave(size: float, phase: float) -> None:
    turn = math.radians(phase)
    cosine, sine = values((size * math.cos(turn), size * math.sin(turn)))[:2]
    (_, amplitude), (_, angle) = Harmonic(1, cosine, sine).rows()
    message = float(amplitude.split()[0]) * (1e-9 if "nm" in amplitude else 1e-6)
    time = np.linspace(0.0, 2.0 * math.pi, 50)
    wave = message * np.cos(time - math.radians(float(angle.split()[0])))
    true = cosine.value * np.cos(time) + sine.value * np.sin(time)
    assert np.max(np.abs(wave - true)) < 0.2 * 2.6e-9 + 0.01 * size


def test_cosine_and_sine_are_judged_together() -> None:
    """By chi squared of two numbers, 5.99 at 95 %: 1.25 times the interval of either."""
    assert not Harmonic(1, *values((3.0e-9, 0.0))[:2]).significant
    assert Harmonic(1, *values((3.4e-9, 0.0))[:2]).significant
