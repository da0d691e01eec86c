"""A measured reversal curve, and the record that several make together."""

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array

KILO = 1e3


@frozen(eq=False)
class ReversalCurve:
    """A first-order reversal curve from its turning point up: inputs and outputs, both (n,)."""

    inputs: Array
    outputs: Array

    def up_to(self, top: float) -> "ReversalCurve":
        """Return the curve to an input that it reaches, where it ends between points."""
        below = self.inputs < top
        end = np.interp(top, self.inputs, self.outputs)
        return ReversalCurve(
            np.append(self.inputs[below], top), np.append(self.outputs[below], end)
        )


def joined(curves: Sequence[ReversalCurve], sample_period: float) -> Record:
    """Return the record of curves one after another, the inputs in thousands.

    It begins where they end. An output was measured together with its input, and a displacement is
    read just before the next drive: it stands one sample later.
    """
    ends = curves[0].inputs[-1:], curves[0].outputs[-1:]
    inputs = np.concatenate([ends[0], *(curve.inputs for curve in curves)])
    outputs = np.concatenate([ends[1], ends[1], *(curve.outputs for curve in curves)])
    return Record(np.append(inputs, inputs[-1]) / KILO, outputs, sample_period)
