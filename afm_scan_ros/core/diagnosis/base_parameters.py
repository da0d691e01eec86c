"""Parameters of the base model that are free in every hypothesis, within their intervals.

The model states 95 % intervals of creep, resonance and lag. The prior of such a parameter is normal
about the model's value, with the standard deviation of the interval. The displacement is taken as
linear in the parameter: the secant between one standard deviation to either side.

The interval of the gain is none of the model's gain. It is that of a record's gain over the gain
that the hysteresis fixes.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial

import numpy as np
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.evidence import Evidence
from afm_scan_ros.core.effects.parameter_shift import insert_resonance
from afm_scan_ros.core.effects.vibration import first_resonance
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import CONFIDENT
from afm_scan_ros.core.types import Array

NEGLIGIBLE = 0.01
"""Information of the records on a parameter over that of its prior, below which it is fixed."""
LAG_POLYNOMIAL = 2
"""Coefficients of the denominator of 1/(1 + s lag)."""
Changed = Callable[[Chain, float], Chain]


@frozen(eq=False)
class BaseParameter:
    """A parameter, its value in the model, and its standard deviation there.

    ``ends`` are one deviation to either side. ``changed`` gives the chain with another value.
    """

    name: str
    unit: str
    value: float
    ends: tuple[float, float]
    changed: Changed

    @property
    def deviation(self) -> float:
        """Standard deviation, in ``unit``."""
        return 0.5 * (self.ends[1] - self.ends[0])

    def influence(self, evidence: Evidence, chain: Chain) -> Array:
        """Displacement (n,) in m that one standard deviation adds in a record."""
        low, high = (evidence.playback.displacement(self.changed(chain, e)) for e in self.ends)
        return np.asarray(0.5 * (high - low))


def with_base_parameters(
    evidence: Sequence[Evidence], chain: Chain
) -> tuple[tuple[BaseParameter, ...], tuple[Evidence, ...]]:
    """Return the parameters that the records can tell, and the evidence with their influence."""
    known = tuple(_stated(chain))
    found = [np.array([one.influence(e, chain) for one in known]) for e in evidence]
    each = [_information(e, rows) for e, rows in zip(evidence, found, strict=True) if len(rows)]
    kept = np.flatnonzero(np.sum(each, axis=0) > NEGLIGIBLE) if each else np.empty(0, dtype=int)
    if not len(kept):
        return (), tuple(evidence)
    free = (evolve(e, base=rows[kept]) for e, rows in zip(evidence, found, strict=True))
    return tuple(known[i] for i in kept), tuple(free)


def _information(evidence: Evidence, influence: Array) -> Array:
    """Information (m,) of a record on each parameter over its prior's."""
    moved = evidence.cells.along(influence)
    power = np.diagonal(evidence.cells.products(moved, moved), axis1=1, axis2=2)
    return np.asarray(evidence.variance.weights(np.zeros(len(power))) @ power)


def _stated(chain: Chain) -> Iterator[BaseParameter]:
    """Yield the parameters of which the model states a closed interval."""
    known = chain.model.effects
    of_vibration = _of_vibration(chain) if known.vibration.intervals else iter(())
    values = {each[0]: each for each in (*_of_creep(chain), *of_vibration)}
    for each in (*known.creep.intervals, *known.vibration.intervals):
        if each.name in values and each.lower is not None and each.upper is not None:
            _, value, least, changed = values[each.name]
            sides = max(each.lower, least), each.upper
            low, high = (value + (end - value) / CONFIDENT for end in sides)
            yield BaseParameter(each.name, each.unit, value, (low, high), changed)


Values = Iterator[tuple[str, float, float, Changed]]
"""Name, value, least value, and the chain with another value."""


def _of_creep(chain: Chain) -> Values:
    creep = chain.model.creep

    def changed(key: str, place: int, chain: Chain, value: float) -> Chain:
        values = list(getattr(creep, key))
        values[place] = value
        return chain.with_model(creep=evolve(creep, **{key: values}))

    for key, name, least in (("gains", "gain", -np.inf), ("time_constants", "time_constant", 0.0)):
        for place, value in enumerate(getattr(creep, key)):
            yield f"{name}_{place + 1}", value, least, partial(changed, key, place)


def _of_vibration(chain: Chain) -> Values:
    """Yield the lag, or frequency and damping of the first resonance where there is one."""
    *_, slow, still = chain.model.vibration.denominator
    if len(chain.model.vibration.denominator) == LAG_POLYNOMIAL:
        yield "lag", slow / still, 0.0, _with_lag
    with suppress(InputError):
        found = first_resonance(chain.model.vibration)
        hertz, damping = found.frequency, found.damping
        yield "resonance", hertz, 0.0, lambda c, v: insert_resonance(c, np.array([v / hertz, 1.0]))
        yield (
            "damping",
            damping,
            0.0,
            lambda c, v: insert_resonance(c, np.array([1.0, v / damping])),
        )


def _with_lag(chain: Chain, lag: float) -> Chain:
    still = chain.model.vibration.denominator[-1]
    return chain.with_vibration(denominator=(lag * still, still))
