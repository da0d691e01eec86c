"""Loops over samples, compiled: the one place that names numba.

Numba keeps the machine code beside the source, or in the user's cache where that is read-only.
"""

import logging
from collections.abc import Callable, Collection
from functools import cache, cached_property, update_wrapper
from types import ModuleType
from typing import Generic, Literal, ParamSpec, TypeVar

from afm_scan_ros.core.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")

LOG = logging.getLogger(__name__)


@cache
def _announce_compilation() -> None:
    """Log one warning when a loop is compiled for which the cache holds no machine code."""
    from numba.core import event  # noqa: PLC0415 - slow to import

    class Announcement(event.Listener):
        """Is called at each compilation."""

        announced = False

        def on_start(self, _: object) -> None:
            """Say it of the first one."""
            if not self.announced:
                LOG.warning("compiling loops for this machine, once after installation")
            self.announced = True

        def on_end(self, _: object) -> None:
            """Say nothing."""

    event.register("numba:compile", Announcement())  # type: ignore[no-untyped-call] # numba's


def _numba() -> ModuleType:
    """Import numba; raises InputError where it is missing, as on a plain Ubuntu 24.04."""
    try:
        import numba  # noqa: PLC0415 - slow to import
    except ImportError as error:
        raise InputError(f"{error}: install numba, as by pip install 'numba>=0.59'") from error
    return numba


class Compiled(Generic[P, R]):
    """A loop that becomes machine code when it is first called, as importing numba takes long."""

    def __init__(
        self,
        function: Callable[P, R],
        inline: Literal["never", "always"] = "never",
        regroups: Collection[str] = (),
    ) -> None:
        update_wrapper(self, function)
        self._inline, self._regroups = inline, set(regroups)
        # Where another loop calls this one, numba looks for these names.
        self.py_func, self.targetoptions = function, {"inline": inline}

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Run the machine code."""
        return self._machine_code(*args, **kwargs)

    @cached_property
    def _machine_code(self) -> Callable[P, R]:
        numba = _numba()
        _announce_compilation()
        options = {"inline": self._inline, "fastmath": self._regroups}
        result: Callable[P, R] = numba.njit(cache=True, nogil=True, **options)(self.py_func)
        return result

    @cached_property
    def _numba_type_(self) -> object:
        """What numba takes it for where another loop calls it."""
        return _numba().typeof(self._machine_code)


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and scalars to machine code, kept on disk between runs."""
    return Compiled(function)


def regrouped(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a loop whose sums may be taken in any order, which changes them by rounding."""
    return Compiled(function, regroups=("reassoc", "contract", "nsz"))


def inlined(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as part of each loop that calls it, for what runs every sample."""
    return Compiled(function, "always")
