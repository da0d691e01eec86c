"""Loops over samples, compiled: the one place that names numba."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Generic, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")


class Compiled(Generic[P, R]):
    """A loop that becomes machine code when it is first called.

    Importing numba takes longer than many a command does, most of which call no loop.
    """

    def __init__(self, function: Callable[P, R]) -> None:
        update_wrapper(self, function)
        self._function = function

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the machine code."""
        return self._machine_code(*args, **kwargs)

    @cached_property
    def _machine_code(self) -> Callable[P, R]:
        import numba  # noqa: PLC0415 - slow to import, see above

        result: Callable[P, R] = numba.njit(cache=True)(self._function)
        return result

    @cached_property
    def _numba_type_(self) -> object:
        """What numba takes it for where another loop calls it."""
        import numba  # noqa: PLC0415 - slow to import, see above

        return numba.typeof(self._machine_code)  # type: ignore[no-untyped-call] # numba's is untyped


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and scalars to machine code, kept on disk between runs."""
    return Compiled(function)
