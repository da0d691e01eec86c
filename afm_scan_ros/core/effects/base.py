"""What every physical effect can do: be applied to a block of samples, and be inverted on one."""

from typing import Protocol, TypeVar

from afm_scan_ros.core.types import Array

ForwardState = TypeVar("ForwardState")
InverseState = TypeVar("InverseState")


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
