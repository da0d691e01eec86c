"""What an operator of hysteresis is to the fit."""

from collections.abc import Mapping
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from afm_scan_ros.core.types import Array

Columns: TypeAlias = NDArray[np.float32] | NDArray[np.float64]
"""Derivatives: there may be gigabytes of them, and only steps are made of them."""


class Operator(Protocol):
    """Hysteresis from a drive between ``lower`` and ``upper`` (V), half of it ``half``, to A (V).

    ``parts`` names groups of parameters with their sizes, ``bends`` is the number of coefficients
    of the map behind it. The columns of one that is ``linear`` do not depend on its parameters.
    """

    @property
    def lower(self) -> float:
        """Least drive, V."""

    @property
    def upper(self) -> float:
        """Greatest drive, V."""

    @property
    def bends(self) -> int:
        """Number of coefficients of the map behind it."""

    @property
    def linear(self) -> bool:
        """Whether A is linear in the parameters."""

    @property
    def half(self) -> float:
        """Half the drive's range, V."""

    @property
    def parts(self) -> Mapping[str, int]:
        """Number of parameters of each group."""

    def unbent(self) -> Array:
        """Return the parameters of no hysteresis, A = u."""

    def precision(self, name: str, scales: Mapping[str, float]) -> Array:
        """Precision of the prior of a group of parameters."""

    def output(self, theta: Array, drive: Array, *, rested: bool) -> Array:
        """A (V) for a drive (V), both (n,), from depolarised rest or settled at its start."""

    def columns(self, theta: Array, drive: Array, block: int, *, rested: bool) -> Columns:
        """∂A/∂theta averaged over blocks of samples, shape (blocks, parameters)."""
