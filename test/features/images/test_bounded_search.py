"""A number that ends at a bound of its search has an open interval: the best may lie beyond."""

from collections.abc import Sequence

import numpy as np
import pytest
from attrs import frozen

from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.loops.moving import LinearDynamics
from afm_scan_ros.features.images.loops.search import (
    NO_CREEP,
    Densities,
    Form,
    OneCreep,
    search,
)

RNG = np.random.default_rng(5)
SLOPES, NOISE = RNG.standard_normal((2, 400)), 0.01 * RNG.standard_normal(400)


@frozen(eq=False)
class Ramp(Densities):
    """Residual that grows with the distance of gain and time constant from the ``best`` ones."""

    best: tuple[float, float]

    def residual(self, dynamics: LinearDynamics) -> Array:
        if not dynamics.creep.gains:
            return np.full(400, 10.0)
        gain, seconds = dynamics.creep.gains[0], dynamics.creep.time_constants[0]
        away = np.array([gain - self.best[0], np.log(seconds / self.best[1])])
        return np.asarray(away @ SLOPES + NOISE)

    def pieces(self) -> Sequence[slice]:
        return [slice(i, i + 40) for i in range(0, 400, 40)]


class Creep(OneCreep):
    """Gain from 0 to 0.5, time constant from 0.1 to 10 s."""

    def __init__(self) -> None:
        self.bounds = np.array([[0.0, np.log(0.1)], [0.02, 0.0], [0.5, np.log(10.0)]])


@pytest.mark.parametrize(
    ("gain", "seconds", "closed"),
    [(0.3, 2.0, (True, True)), (0.8, 2.0, (False, True)), (0.3, 40.0, (True, False))],
)
def test_an_interval_is_open_at_a_bound(
    gain: float, seconds: float, closed: tuple[bool, bool]
) -> None:
    forms: list[Form] = [Creep()]
    known = LinearDynamics(VibrationModel((1.0,), (1e-6, 1.0)), NO_CREEP)
    found = search(Ramp((), 0.0, (gain, seconds)), known, forms)
    (intervals,) = found.intervals
    assert found.identified == (True,)
    assert tuple(each.upper is not None for each in intervals) == closed
    assert tuple(each.lower is not None for each in intervals) == closed
