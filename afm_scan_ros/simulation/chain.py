"""The scanner's physics from converter to displacement, both axes: a chain of links.

    drive -> inserts -> hysteresis -> F -> vibration and creep -> attachments -> inserts

A link's state holds all that it remembers and is never changed in place, so that blocks cut
anywhere give the same path. A scanner without mechanisms is solved from update to update of the
converter. Mechanisms act between updates too: with one, all runs in steps of at most ``STEP``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import ceil
from typing import Any, Protocol, TypeAlias

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.simulation.axis_spec import AxisSpec
from afm_scan_ros.simulation.dynamics import ComplexArray, Dynamics, first_resonance
from afm_scan_ros.simulation.mechanisms.attachment import AttachedStage, Attachment
from afm_scan_ros.simulation.mechanisms.base import Alteration, Bank, Blocks, Insert, Mechanism
from afm_scan_ros.simulation.play import PlayBank
from afm_scan_ros.simulation.spec import PlantSpec

STEP = 5e-6  # s
AT_ONCE = 20_000  # steps: what a processor's cache holds

States: TypeAlias = tuple[Any, ...]


class SimulatedElement(Protocol):
    """A part of the chain: signals of both axes in, signals of both axes out, shape (2, n)."""

    def at_rest(self, step: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - each its own
        """State of an undriven scanner."""

    def apply(self, state: Any, signals: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """New state, and what becomes of the signals, sampled every ``step`` s."""


@frozen(eq=False)
class PerAxis:
    """What each axis does by itself: its hysteresis, or its structure.

    ``starts`` give the state at rest of each axis; ``moves`` take it, a signal and the step (s).
    """

    starts: tuple[Callable[[], Array | ComplexArray], ...]
    moves: tuple[Callable[[Any, Array, float], tuple[Any, Array]], ...]

    def at_rest(self, step: float, rng: np.random.Generator) -> States:  # noqa: ARG002
        """Virgin plays, or sections at zero."""
        return tuple(start() for start in self.starts)

    def apply(self, state: States, signals: Array, step: float) -> tuple[States, Array]:
        """Move, exactly while the signals are held for a step."""
        moved = [m(s, u, step) for m, s, u in zip(self.moves, state, signals, strict=True)]
        states, paths = zip(*moved, strict=True)
        return states, np.array(paths)


class SimulatedChain:
    """All links of a scanner whose converter is updated every ``sample_period`` s."""

    def __init__(self, spec: PlantSpec, sample_period: float) -> None:
        self._substeps = ceil(sample_period / STEP) if spec.mechanisms else 1
        self._step = sample_period / self._substeps
        self._links = _links(spec, self._step)

    def at_rest(self, rng: np.random.Generator) -> States:
        """State of a virgin scanner: never driven."""
        return tuple(link.at_rest(self._step, rng) for link in self._links)

    def advance(self, states: States, drive: Trace) -> tuple[States, Trace]:
        """True displacement (m) just before each update of the drive (V)."""
        updates, paths = np.array([drive.x, drive.y]), []
        samples = max(1, AT_ONCE // self._substeps)
        for first in range(0, drive.x.size, samples):
            states, path = self._advance(states, updates[:, first : first + samples])
            paths.append(path)
        x, y = np.concatenate(paths, axis=1)
        return states, Trace(drive.first_sample, drive.sample_period, x, y)

    def _advance(self, states: States, updates: Array) -> tuple[States, Array]:
        signals, after = np.repeat(updates, self._substeps, axis=1), []
        for link, state in zip(self._links, states, strict=True):
            new, signals = link.apply(state, signals, self._step)
            after.append(new)
        return tuple(after), signals[:, :: self._substeps]


def _links(spec: PlantSpec, step: float) -> Sequence[SimulatedElement]:
    axes = _axes(spec)
    dynamics = [Dynamics.from_spec(axis, spec.sensor_sensitivity) for axis in axes.values()]
    inserts = [each for each in spec.mechanisms if isinstance(each, Insert)]
    stages = {name: AttachedStage.of_pole(first_resonance(a.vibration)) for name, a in axes.items()}
    attachments = (each for each in spec.mechanisms if isinstance(each, Attachment))
    return (
        *(insert for insert in inserts if insert.PLACE == "drive"),
        _hysteresis(axes, spec.mechanisms, step),
        PerAxis(tuple(d.at_rest for d in dynamics), tuple(d.apply for d in dynamics)),
        *(each.attached(stages[each.axis]) for each in attachments),
        *(insert for insert in inserts if insert.PLACE == "displacement"),
    )


def _axes(spec: PlantSpec) -> dict[str, AxisSpec]:
    """What each axis is made of by now."""
    axes = spec.axes()
    for mechanism in spec.mechanisms:
        if isinstance(mechanism, Alteration):
            axes[mechanism.axis] = mechanism.altered(axes[mechanism.axis])
    return axes


def _hysteresis(
    axes: Mapping[str, AxisSpec], mechanisms: Iterable[Mechanism], step: float
) -> PerAxis:
    """Drive (V) to effective input F (V) of each axis."""
    plays = {name: PlayBank.from_spec(axis.hysteresis) for name, axis in axes.items()}
    blocks = (each for each in mechanisms if isinstance(each, Blocks))
    dragged = {each.axis: each.bank(plays[each.axis], step) for each in blocks}
    banks = [dragged.get(name, plays[name]) for name in AXES]
    return PerAxis(tuple(b.relaxed for b in banks), tuple(map(_held, banks)))


def _held(bank: Bank) -> Callable[[Any, Array, float], tuple[Any, Array]]:
    """Return how a bank, which knows its step, moves."""
    return lambda state, drive, _step: bank.apply(state, drive)
