"""Effects that act in the feedback of a coupled structure, as inputs added to it.

x[k+1] = A x[k] + B u[k] + E w[k], y[k] = C x[k] + D u[k] + F w[k] and w = elements(u, y). The
structure's response to an added input is identified with the rest. So an element states the shape
of an effect and not its size. Source of the form: M. Schoukens and R. Toth, On the initialization
of nonlinear LFR model identification with the best linear approximation, 2020, arXiv:2004.05040.
"""

from typing import Protocol

import numpy as np
from attrs import cmp_using, field, frozen

from afm_scan_ros.core.types import Array

_array = cmp_using(eq=np.array_equal)


@frozen
class Actuators:
    """Scales of a structure's m drives and p outputs.

    ``drive_scale`` (m,) is the rms of each drive (V) in the records. ``elongation`` (m, p), 1/m,
    gives of the outputs (m) the drives that would hold them at rest, each over its rms there.
    Vibrations last for ``decay_time`` (s) typically; ``sample_period`` is in s.
    """

    drive_scale: Array = field(eq=_array)
    elongation: Array = field(eq=_array)
    decay_time: float
    sample_period: float

    def scaled(self, drive: Array) -> Array:
        """Drives (n, m) over their scales."""
        return drive / self.drive_scale

    def elongations(self, output: Array) -> Array:
        """Elongations (n, m) of outputs (n, p), dimensionless."""
        return np.asarray(output @ self.elongation.T)


class FeedbackElement(Protocol):
    """An effect that adds inputs to a structure."""

    def added(self, drive: Array, output: Array, run: int) -> Array:
        """Inputs (n, added) of drive (n, m) in V and output (n, p) in m.

        The first ``run`` samples count: all n of a period in steady state; fewer of a run from
        rest, which zeros follow.
        """
        ...
