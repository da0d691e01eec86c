"""Mechanisms that are attached to the structure and pull back at it.

What an axis does under the piezo, x_d, and under an attachment's force f are superposed,

    x = x_d + u,    u'' + 2 d w u' + w^2 u = w^2 f,

with w and d of the axis' first resonance, which the force meets where the sample is, and f in
metres: as far as it would move the scanner if it stayed. As f depends on x, the resonances of the
whole are other ones than those of the parts. Integrated by Runge-Kutta's fourth order, x_d running
straight within a step.
"""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array
from afm_scan_ros.simulation.mechanisms.base import Mechanism


@frozen
class Stage:
    """First resonance of an axis: ``natural`` frequency (rad/s) and ``damping`` ratio."""

    natural: float
    damping: float

    @classmethod
    def of_pole(cls, pole: complex) -> "Stage":
        """Resonance with this pole, 1/s."""
        return cls(abs(pole), -pole.real / abs(pole))


@frozen(eq=False)
class Attached(ABC):
    """What is attached to axis ``row`` of the chain, at ``stage``.

    State: u (m), u' (m/s) and what the attachment has of its own, shape (2 + m,), and the last
    x_d of the axis and of the other one, m, shape (2,).
    """

    row: int
    stage: Stage

    @abstractmethod
    def own_at_rest(self) -> Array:
        """State of the attachment itself, shape (m,)."""

    @abstractmethod
    def integrate(self, state: Array, path: Array, step: float) -> Array:
        """U (m) at each but the first of the instants of ``path``; ``state`` becomes the last.

        ``path`` is x_d of the axis and displacement of the other one, m, shape (2, n + 1).
        """

    def at_rest(self, step: float, rng: np.random.Generator) -> tuple[Array, Array]:  # noqa: ARG002
        """Nothing moves."""
        return np.concatenate((np.zeros(2), self.own_at_rest())), np.zeros((2, 1))

    def apply(self, state: Any, signals: Array, step: float) -> tuple[Any, Array]:  # noqa: ANN401
        """Displacements (m) with the attachment, both axes, shape (2, n)."""
        moving, last = state
        moving, signals = moving.copy(), signals.copy()
        order = [self.row, 1 - self.row]
        path = np.concatenate((last, signals[order]), axis=1)
        signals[self.row] += self.integrate(moving, path, step)
        return (moving, path[:, -1:]), signals


class Attachment(Mechanism):
    """A mechanism that is attached to the structure."""

    @abstractmethod
    def attached(self, stage: Stage) -> Attached:
        """The attachment at an axis of this resonance."""
