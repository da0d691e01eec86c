"""Loops over samples, compiled: the one place that names numba."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and scalars to machine code, kept on disk between runs."""
    result: Callable[P, R] = numba.njit(cache=True)(function)
    return result
