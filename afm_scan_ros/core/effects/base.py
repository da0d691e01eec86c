"""The interface of every physical effect, and the elements of which a chain consists.

An ``Effect`` runs at one sample period. An ``Element`` is an effect with its parameters, whose
sample period is still open: a frozen value, equal to another one where their parameters are equal.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from attrs import frozen

from afm_scan_ros.core.types import Array

ForwardState = TypeVar("ForwardState")
InverseState = TypeVar("InverseState")
E = TypeVar("E")
E_co = TypeVar("E_co", covariant=True)


class Effect(Protocol[ForwardState, InverseState]):
    """One effect along one axis, at one sample period.

    The contract, as equations that the tests check for every effect:

    - blocks: applying to ``a`` and then, with the state returned, to ``b`` gives the same as
      applying to ``a + b``; the same for ``invert``. A state that was passed in is not changed.
    - inverse: ``invert`` over all blocks, then ``finish``, gives as many samples as went in, and
      ``apply`` of them gives the target back within the band that the effect declares.

    An inverse that looks ahead returns fewer samples at first; ``finish`` returns those still
    owed, as if the last sample were held.
    """

    def at_rest(self) -> ForwardState:
        """State of the effect itself before the first sample: at rest at zero, depolarised."""
        ...

    def apply(self, state: ForwardState, block: Array) -> tuple[ForwardState, Array]:
        """Output of the effect for a block of input samples, both of shape (n,)."""
        ...

    def inverse_at_rest(self) -> InverseState:
        """State of the inverse before the first sample."""
        ...

    def invert(self, state: InverseState, block: Array) -> tuple[InverseState, Array]:
        """Input that makes the effect's output follow ``block``; may return fewer samples."""
        ...

    def finish(self, state: InverseState) -> Array:
        """Return the samples that ``invert`` still owes after the last block."""
        ...


AnyEffect = Effect[Any, Any]


States = tuple[Any, ...]


@frozen
class Cascade:
    """Effects in the order in which the signal passes them; itself an Effect.

    Inverting walks them from the last to the first: Croft, Shed and Devasia (2001), Eq. 23. An
    effect that looks ahead hands on fewer samples at first, so blocks vary in length inside.
    """

    effects: tuple[AnyEffect, ...]

    def at_rest(self) -> States:
        """States of all effects, in their order."""
        return tuple(effect.at_rest() for effect in self.effects)

    def apply(self, state: States, block: Array) -> tuple[States, Array]:
        """Output of the last effect for a block of input to the first, both (n,)."""
        states = []
        for effect, before in zip(self.effects, state, strict=True):
            after, block = effect.apply(before, block)
            states.append(after)
        return tuple(states), block

    def inverse_at_rest(self) -> States:
        """States of all inverses, in the order of the effects."""
        return tuple(effect.inverse_at_rest() for effect in self.effects)

    def invert(self, state: States, block: Array) -> tuple[States, Array]:
        """Input to the first effect whose output from the last follows ``block``."""
        states = []
        for effect, before in zip(self.effects[::-1], state[::-1], strict=True):
            after, block = effect.invert(before, block)
            states.append(after)
        return tuple(states[::-1]), block

    def finish(self, state: States) -> Array:
        """Return the samples still owed: each inverse's, passed on through those after it."""
        owed = np.empty(0)
        for effect, before in zip(self.effects[::-1], state[::-1], strict=True):
            after, passed = effect.invert(before, owed)
            owed = np.concatenate((passed, effect.finish(after)))
        return owed


class CausalInverse(ABC):
    """Base of effects whose inverse begins as they do and never owes a sample."""

    @abstractmethod
    def at_rest(self) -> Any:  # noqa: ANN401 - each effect's own
        """State before the first sample, also of the inverse."""

    def inverse_at_rest(self) -> Any:  # noqa: ANN401 - each effect's own
        """State of the inverse before the first sample."""
        return self.at_rest()

    def finish(self, state: Any) -> Array:  # noqa: ANN401, ARG002 - each effect's own
        """Return nothing: no sample is ever owed."""
        return np.empty(0)


class Recursion(CausalInverse):
    """Base of effects that step from sample to sample, and whose inverse solves the same steps."""

    @abstractmethod
    def run(self, state: Any, block: Array, direction: float) -> tuple[Any, Array]:  # noqa: ANN401
        """State after a block, and its outputs where ``direction`` is 1, its inputs where -1."""

    def apply(self, state: Any, block: Array) -> tuple[Any, Array]:  # noqa: ANN401
        """Outputs for a block of inputs, both (n,)."""
        return self.run(state, block, 1.0)

    def invert(self, state: Any, block: Array) -> tuple[Any, Array]:  # noqa: ANN401
        """Inputs for a block of outputs, both (n,)."""
        return self.run(state, block, -1.0)


class StatelessEffect(CausalInverse):
    """Base of effects whose output depends on the present input alone; the state is None.

    Each is its own element of a chain: a frozen class, which compares by value.
    """

    @abstractmethod
    def output(self, inputs: Array) -> Array:
        """Outputs for inputs, both (n,)."""

    @abstractmethod
    def input(self, outputs: Array) -> Array:
        """Inputs that give the outputs, both (n,)."""

    def at(self, sample_period: float) -> Self:  # noqa: ARG002 - the same at each
        """Return the effect at a sample period (s)."""
        return self

    def at_rest(self) -> None:
        """Return no state."""

    def apply(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Outputs for a block of inputs, both (n,)."""
        return None, self.output(block)

    def invert(self, state: None, block: Array) -> tuple[None, Array]:  # noqa: ARG002 - Effect's
        """Inputs for a block of outputs, both (n,)."""
        return None, self.input(block)


LEVELS, NEWTON_STEPS = 2049, 3
"""Of the table that a rising curve is solved from, and what follows it:
each step squares the error, two reach rounding."""


def solved(
    curve: Callable[[Array], tuple[Array, Array]], levels: Array, heights: Array, wanted: Array
) -> Array:
    """Where a rising ``curve``, of height and slope, has the heights wanted, by Newton's method."""
    found = np.interp(wanted, heights, levels)
    for _ in range(NEWTON_STEPS):
        height, slope = curve(found)
        found = found - (height - wanted) / slope
    return found


@frozen
class Gain(StatelessEffect):
    """A gain, in the unit of the output over that of the input, in the place of an effect."""

    gain: float

    def output(self, inputs: Array) -> Array:
        """Outputs for inputs, both (n,)."""
        return self.gain * inputs

    def input(self, outputs: Array) -> Array:
        """Inputs for outputs, both (n,)."""
        return outputs / self.gain


class ChainElement(Protocol[E_co]):
    """What a chain holds: a value that compares by its parameters."""

    def at(self, sample_period: float) -> E_co:
        """Return the effect at a sample period (s)."""
        ...


@frozen
class Element(Generic[E]):
    """An effect and its parameters, which may be numbers, strings, tuples and frozen records.

    ``make`` is a class or a function of a module, of the parameters and the sample period (s).
    Both are compared, so a lambda or a closure would never equal another one.
    """

    make: Callable[..., E]
    parameters: tuple[Any, ...] = ()

    def at(self, sample_period: float) -> E:
        """Return the effect at a sample period (s)."""
        return self.make(*self.parameters, sample_period)
