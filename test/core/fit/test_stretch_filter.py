"""A filter of means over stretches gives the means of what it makes of the samples."""

import numpy as np
import pytest
from scipy import signal

from afm_scan_ros.core.fit.stretches import Edges, StretchFilter, means
from afm_scan_ros.core.types import Array

PERIOD = 1e-4
POLES = np.array([2000.0 * (-0.02 + 1j), -3e4, -500.0, -2.0])
WEIGHTS = np.array([0.5 - 0.1j, 0.3, 0.1, 0.05])
COUNT = 4096
TIMES = np.arange(COUNT)


def of_samples(inputs: Array, settled: float) -> Array:
    """What SciPy's filters make of held samples, read before each update."""
    total = np.zeros(len(inputs))
    for pole, weight in zip(POLES, WEIGHTS, strict=True):
        z = np.exp(pole * PERIOD)
        begun = np.array([settled * z + 0j]) / z
        state, _ = signal.lfilter([0.0, 1.0 - z], [1.0, -z], inputs.astype(complex), zi=begun)
        total += (weight * state).real
    return total


def error_of(inputs: Array, edges: Edges) -> float:
    """Largest error over the largest output, but for the end, whose slope is one-sided."""
    found = StretchFilter((POLES, WEIGHTS), 0.0, PERIOD, edges, inputs[:1])
    pieces = np.array_split(means(inputs, edges)[:, np.newaxis], 3)
    following = [pieces[1][0], pieces[2][0], None]
    output = np.concatenate([found(*each) for each in zip(pieces, following, strict=True)])[:, 0]
    expected = means(of_samples(inputs, float(inputs[0])), edges)
    return float(np.abs(output - expected)[:-1].max() / np.abs(expected).max())


UNEVEN = np.concatenate([np.arange(64), np.arange(64, 1024, 8), np.arange(1024, COUNT + 1, 64)])


@pytest.mark.parametrize("edges", [np.arange(COUNT + 1), UNEVEN], ids=["samples", "uneven"])
def test_it_is_exact_for_steps_between_samples_and_for_lines_between_stretches(
    edges: Edges,
) -> None:
    ramp = 0.001 * TIMES
    assert error_of(ramp, edges) < 1e-4 if len(edges) < COUNT else error_of(ramp, edges) < 1e-12
    step = np.where(TIMES < 10, 0.0, 1.0)
    assert error_of(step, edges) < 1e-12


@pytest.mark.parametrize(("turn", "most"), [(0.8, 8e-3), (0.4, 6e-4), (0.2, 4e-5)])
def test_its_error_falls_with_the_fourth_power_of_the_turn_of_a_wave_in_a_stretch(
    turn: float, most: float
) -> None:
    rising = np.sin(0.5 * np.pi * np.minimum(TIMES / 1000.0, 1.0)) ** 4
    inputs = rising * np.sin(turn / 16.0 * TIMES)
    assert error_of(inputs, np.arange(0, COUNT + 1, 16)) < most
