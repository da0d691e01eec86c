"""What a mechanism is, and the ways in which one gets into the scanner.

    converter -> [drive] -> hysteresis -> structure -> [displacement] -> sensor

A mechanism belongs to one axis, whose motion it changes. It is an ``Insert``, which changes the
signal at one of the two places in brackets, an ``Alteration``, which changes what the axis is
made of, an ``Attachment`` to the structure (attachment.py), or in the ``Blocks`` of the hysteresis
itself.

Time runs in steps of some microseconds, many to a period of the converter: what a mechanism does
between two updates is part of its physics. A drive is constant over a step, the mean of what is
there; a displacement is that at the beginning of the step.
"""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, TypeAlias

import numpy as np
from attrs import field, frozen
from attrs.validators import in_

from afm_scan_ros.core.types import AXES, Array

if TYPE_CHECKING:
    from afm_scan_ros.simulation.play import PlayBank
    from afm_scan_ros.simulation.spec import AxisSpec

Place: TypeAlias = Literal["drive", "displacement"]


@frozen(kw_only=True)
class Mechanism(ABC):
    """A mechanism of one axis; ``KIND`` names it in a plant file."""

    KIND: ClassVar[str]

    axis: str = field(validator=in_(AXES))

    @property
    def row(self) -> int:
        """Where the axis stands among the axes."""
        return AXES.index(self.axis)


class Insert(Mechanism):
    """A mechanism that changes a signal: drive (V) or displacement (m)."""

    PLACE: ClassVar[Place]

    @abstractmethod
    def at_rest(self, step: float, rng: np.random.Generator) -> Any:  # noqa: ANN401 - each its own state
        """State of an undriven scanner; ``rng`` draws what differs from one scan to the next."""

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


class Alteration(Mechanism):
    """A mechanism by which the axis is no longer made of what it was made of."""

    @abstractmethod
    def altered(self, axis: "AxisSpec") -> "AxisSpec":
        """What the axis is made of with the mechanism."""


class Bank(Protocol):
    """Blocks of a hysteresis, which a drive drags along; ``PlayBank`` is that of a healthy one."""

    def relaxed(self) -> Array:
        """State of a virgin scanner."""

    def apply(self, state: Array, drive: Array) -> tuple[Array, Array]:
        """New state, and effective input F (V) of a block of drive (V), both of shape (n,)."""


class Blocks(Mechanism):
    """A mechanism by which the blocks of the hysteresis do not follow the drive at once."""

    @abstractmethod
    def bank(self, plays: "PlayBank", step: float) -> Bank:
        """The hysteresis of ``plays`` with it, for a drive that is held for ``step`` s."""
