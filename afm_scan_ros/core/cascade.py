"""A cascade of effects: the model when applied forwards, its inverse when walked backwards."""

from typing import Any

import numpy as np
from attrs import frozen

from afm_scan_ros.core.effects.base import AnyEffect
from afm_scan_ros.core.types import Array

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
