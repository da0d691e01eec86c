"""What a mechanism is, and where one acts in the scanner.

    converter -> [drive] -> hysteresis -> structure -> [displacement] -> sensor

A mechanism changes the motion of one axis. There are four types:

- ``Insert`` changes the signal at one of the two places in brackets;
- ``Alteration`` changes the parameters of the axis;
- ``Attachment`` is attached to the structure and acts back on it (attachment.py);
- ``Blocks`` changes how the plays of the hysteresis follow the drive.

The time step is a few microseconds, many to a period of the converter, so that a mechanism also
acts between two updates. A drive value is the mean over its step. A displacement value is that at
the beginning of its step.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Literal, Protocol, Self, TypeAlias

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, in_

from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.simulation.axis import AxisSpec, PlayBank

Place: TypeAlias = Literal["drive", "displacement"]


@frozen(kw_only=True)
class Mechanism(ABC):
    """A mechanism of one axis; ``KIND`` names it in a plant file.

    A subclass that states its ``KIND`` enters ``KINDS``. TypeError where another class has it.
    """

    KIND: ClassVar[str]
    KINDS: ClassVar[dict[str, "type[Mechanism]"]] = {}

    axis: str = field(validator=in_(AXES))

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "KIND" not in cls.__dict__:
            return
        known = cls.KINDS.get(cls.KIND, cls)
        # attrs makes every class twice, the second time with slots.
        if (known.__module__, known.__qualname__) != (cls.__module__, cls.__qualname__):
            raise TypeError(f"{cls.__qualname__}: {known.__qualname__} has KIND {cls.KIND!r}")
        cls.KINDS[cls.KIND] = cls

    @property
    def row(self) -> int:
        """Where the axis stands among the axes."""
        return AXES.index(self.axis)


class Insert(Mechanism):
    """A mechanism that changes a signal: drive (V) or displacement (m)."""

    PLACE: ClassVar[Place] = "displacement"

    def at_rest(self, step: float, rng: np.random.Generator) -> Any:  # noqa: ANN401, ARG002 - each its own
        """State of an undriven scanner; ``rng`` draws what differs from one scan to the next.

        None where a subclass states no other: its output depends on the present sample alone.
        """
        return None

    @abstractmethod
    def act(self, state: Any, own: Array, other: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """New state, and the axis' signal after the mechanism.

        ``own`` is the signal of the axis and ``other`` that of the other one, both of shape (n,),
        ``step`` s apart. Cutting them into blocks anywhere changes nothing.
        """

    def apply(self, state: Any, signals: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """Let the mechanism act on the signals of both axes, shape (2, n)."""
        state, changed = self.act(state, signals[self.row], signals[1 - self.row], step)
        signals = signals.copy()
        signals[self.row] = changed
        return state, signals


class Clocked(Insert):
    """An insert that depends on time alone; state: elapsed steps, and what was drawn."""

    @abstractmethod
    def drawn(self, rng: np.random.Generator) -> Any:  # noqa: ANN401 - each its own
        """Draw what differs from one scan to the next."""

    @abstractmethod
    def at(self, time: Array, own: Array, drawn: Any) -> Array:  # noqa: ANN401
        """Signal after the mechanism at these instants (s), all of shape (n,)."""

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[int, Any]:  # noqa: ARG002
        """The scan begins."""
        return 0, self.drawn(rng)

    def act(
        self,
        state: tuple[int, Any],
        own: Array,
        other: Array,  # noqa: ARG002
        step: float,
    ) -> tuple[tuple[int, Any], Array]:
        """Signal after the mechanism; a drive's instants are the middles of its steps."""
        elapsed, drawn = state
        within = 0.5 if self.PLACE == "drive" else 0.0
        time = step * (np.arange(elapsed, elapsed + own.size, dtype=np.float64) + within)
        return (elapsed + own.size, drawn), self.at(time, own, drawn)


@frozen(kw_only=True)
class Ageing(Mechanism):
    """A mechanism that goes on from one scan to the next; ``age`` (s) is that at its beginning."""

    age: float = field(default=0.0, validator=ge(0.0), metadata={"suffix": "_s", "scale": 1.0})

    def older(self, by: float) -> Self:
        """Return the mechanism ``by`` s later."""
        return evolve(self, age=self.age + by)


class Alteration(Mechanism):
    """A mechanism that changes the parameters of the axis."""

    @abstractmethod
    def altered(self, axis: AxisSpec) -> AxisSpec:
        """Parameters of the axis with the mechanism."""


class Bank(Protocol):
    """Hysteresis of an axis; ``PlayBank`` is that without a mechanism."""

    def relaxed(self) -> Array:
        """State of a virgin scanner."""

    def apply(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """New state, and effective input F (V) of a block of drive (V), both of shape (n,)."""


class Blocks(Mechanism):
    """A mechanism that changes how the plays of the hysteresis follow the drive."""

    @abstractmethod
    def bank(self, plays: PlayBank, step: float) -> Bank:
        """Hysteresis of ``plays`` with the mechanism, for a drive held for ``step`` s."""
