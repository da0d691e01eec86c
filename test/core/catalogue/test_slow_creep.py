"""Slow creep against its equation: sections in series with the scanner, what has crept included."""

import numpy as np
from scipy.signal import lsim

from afm_scan_ros.bench.scans import default_model
from afm_scan_ros.core.catalogue import entry
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.types import Array

PERIOD = 1e-3
STEP = np.ones(20_000)
MODEL = default_model().x


def step_response(kind: str, *values: float) -> Array:
    """What creep, the model's and the added, makes of a step of 1 m."""
    chain = entry("slow_creep").form(kind).insert(Chain(MODEL), np.array(values))
    (added,) = (maker(PERIOD) for maker in chain.output)
    base = Creep(chain.model.creep, PERIOD)
    moved = base.apply(base.at_rest(), STEP)[1]
    return np.asarray(added.apply(added.at_rest(), moved)[1])


def test_a_section_follows_all_that_the_scanner_does() -> None:
    gain, constant = 0.2, 0.7
    time = PERIOD * np.arange(len(STEP))
    base = [1.0 - np.exp(-time / tau) for tau in MODEL.creep.time_constants]
    moved = 1.0 + np.array(MODEL.creep.gains) @ base
    _, crept, _ = lsim(([gain], [constant, 1.0]), moved, time)
    np.testing.assert_allclose(step_response("", gain, constant), moved + crept, atol=2e-4)


def test_logarithmic_creep_gains_as_much_in_each_decade() -> None:
    grown = step_response("logarithmic", 0.01, 1e-2)
    alone = step_response("logarithmic", 0.0, 1e-2)
    decades = (grown - alone)[[50, 500, 5_000]] / alone[[50, 500, 5_000]]
    np.testing.assert_allclose(np.diff(decades), 0.02, rtol=0.05)
