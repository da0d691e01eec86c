"""The exact response of the linear part, and the states that its derivatives are made of."""

import numpy as np
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from afm_scan_ros.core.fit.dynamics import (
    PoleBank,
    respond,
)
from afm_scan_ros.core.fit.stretches import means
from afm_scan_ros.core.types import Array, Complex

PERIOD, COUNT = 1e-4, 400
NONE = np.zeros(0, complex)


def held(pole: complex, inputs: Array, settled: float) -> Complex:
    """SciPy's state of a pole under held inputs, read before each update."""
    z = np.exp(pole * PERIOD)
    states, _ = signal.lfilter([0.0, 1.0 - z], [1.0, -z], inputs + 0j, zi=np.array([settled + 0j]))
    return np.asarray(states)


def bank(seed: int, modes: int) -> tuple[PoleBank, np.random.Generator]:
    rng = np.random.default_rng(seed)
    poles = rng.uniform(500.0, 5000.0, modes) * (-0.02 + 1j)
    lags, slow = -rng.uniform(2e3, 2e4, 3), rng.uniform(3e-3, 1.0, 4)
    weights = rng.normal(size=modes + 3) + 0j
    weights[:modes] += 1j * rng.normal(size=modes)
    every = np.concatenate([poles, lags])
    return PoleBank(every, weights, rng.uniform(0.0, 0.1, 4), slow, (NONE, NONE)), rng


@given(seed=st.integers(0, 10_000), modes=st.integers(0, 3), eighths=st.integers(-7, 40))
def test_it_is_read_late_as_if_sampled_more_often(seed: int, modes: int, eighths: int) -> None:
    """By less than a sample it may be read early too, while the input is held."""
    drawn, rng = bank(seed, modes)
    fast = evolve(drawn, gains=np.zeros(4))
    inputs = 2.0 + np.cumsum(rng.normal(size=COUNT))
    finer = respond(fast, PERIOD / 8.0, np.repeat(inputs, 8), 2.0).output
    padded = np.concatenate([np.full(40, finer[0]), finer])
    expected = padded[40 - eighths : 40 - eighths + 8 * COUNT : 8]
    found = respond(fast, PERIOD, inputs, 2.0, eighths * PERIOD / 8.0).output
    np.testing.assert_allclose(found[: len(expected)], expected, atol=1e-9)


@given(seed=st.integers(0, 10_000), modes=st.integers(0, 3), settled=st.sampled_from([0.0, 2.0]))
def test_it_is_that_of_filters_in_series(seed: int, modes: int, settled: float) -> None:
    drawn, rng = bank(seed, modes)
    every, weights, gains, slow = drawn.poles, drawn.weights, drawn.gains, drawn.time_constants
    inputs = settled + np.cumsum(rng.normal(size=COUNT))
    edges = np.unique([0, COUNT, *rng.integers(1, COUNT, 40)])
    found = respond(drawn, PERIOD, inputs, settled)

    states = [held(pole, inputs, settled) for pole in every]
    moved = sum((w * x).real for w, x in zip(weights, states, strict=True))
    begun = settled * weights.real.sum()
    late = np.column_stack([held(-1.0 / tau, moved, begun).real for tau in slow])
    np.testing.assert_allclose(found.output, moved + late @ gains, atol=1e-9)

    of_stretches = found.states(edges)
    np.testing.assert_allclose(of_stretches.late, means(late, edges), atol=1e-9)
    for i in range(modes):
        np.testing.assert_allclose(of_stretches.modes[:, i], means(states[i], edges), atol=1e-9)
        step = 1e-6 * every[i]
        up, down = (held(every[i] + way * step, inputs, settled) for way in (1.0, -1.0))
        slope = means((up - down) / (2.0 * step), edges)
        np.testing.assert_allclose(of_stretches.changes[:, i], slope, rtol=1e-4, atol=1e-9)
    lagged = np.column_stack([each.real for each in states[modes:]])
    np.testing.assert_allclose(of_stretches.lags, means(lagged, edges), atol=1e-9)
