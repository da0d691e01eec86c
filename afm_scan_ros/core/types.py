"""What the whole package uses: arrays, runs of samples, progress, and fields of settings."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Self, TypeAlias

import numpy as np
from attrs import define, field, frozen
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]

AXES = ("x", "y")

ProgressCallback: TypeAlias = Callable[[str], None]
"""Is called with what a long computation is doing; a ``Step`` where its parts are counted."""


class Step(str):
    """What is done when ``done`` of a ``total`` of parts are over; ``more`` may be planned."""

    __slots__ = ("done", "more", "total")
    done: int
    total: int
    more: bool

    def __new__(cls, text: str, done: int, total: int, *, more: bool = False) -> Self:
        """Return a step with its text."""
        step = super().__new__(cls, text)
        step.done, step.total, step.more = done, total, more
        return step

    def left(self, elapsed: float) -> float | None:
        """Return how long (s) the rest takes at the pace so far; None before any part is over."""
        return elapsed * (self.total - self.done) / self.done if self.done else None


@define
class Tally:
    """Counts the parts of a search while more are planned; those ``named`` apart count together."""

    _progress: ProgressCallback
    _name: str = ""
    _counts: Counter[str] = field(factory=Counter)

    def named(self, name: str) -> "Tally":
        """Return a tally that begins what it says with a name."""
        return Tally(self._progress, f"{self._name}{name}", self._counts)

    def plan(self, parts: int) -> None:
        """Count parts that are to be done, or fewer of them where ``parts`` is negative."""
        self._counts["planned"] += parts

    def begin(self, doing: str, parts: int = 1) -> None:
        """Say what is being done, which takes so many of the parts that are planned."""
        done, planned = self._counts["done"], self._counts["planned"]
        self._progress(Step(f"{self._name}{doing}", done, planned, more=True))
        self._counts["done"] += parts


def setting(default: float, unit: str, meaning: str, source: str) -> Any:  # noqa: ANN401 - as attrs.field
    """Return the field of a settings class; its default follows from the ``source``."""
    return field(default=default, metadata={"unit": unit, "meaning": meaning, "source": source})


def floats(values: Iterable[float]) -> tuple[float, ...]:
    """Return any run of numbers as a tuple of floats, which compares by value."""
    return tuple(float(value) for value in values)


def pair(values: Iterable[float]) -> tuple[float, float]:
    """Return two numbers as a tuple of floats."""
    first, second = values
    return float(first), float(second)


def contiguous(values: ArrayLike) -> Array:
    """Return numbers as an array of the kind that compiled loops are made for."""
    return np.ascontiguousarray(values, dtype=np.float64)


def by_value(array: Array | None) -> tuple[tuple[int, ...], bytes] | None:
    """Return what two arrays are compared and hashed by; a key for ``attrs.field(eq=...)``."""
    return None if array is None else (array.shape, array.tobytes())


@frozen(eq=False)
class Trace:
    """A run of consecutive x-y samples, in m (displacement) or V (drive), (n,) each.

    ``x[0]`` is sample ``first_sample`` of its scan, from which time counts too.
    """

    first_sample: int
    sample_period: float
    x: Array
    y: Array

    def axis(self, name: str) -> Array:
        """Return the samples of axis ``"x"`` or ``"y"``."""
        return {"x": self.x, "y": self.y}[name]


def trace_of(values: Array, axes: Sequence[str], sample_period: float) -> Trace:
    """Return values (n, channels) as both axes of a run from sample 0; an absent one is zero."""
    given = {name: values[:, channel] for channel, name in enumerate(axes)}
    still = np.zeros(len(values))
    return Trace(0, sample_period, *(given.get(name, still) for name in AXES))


def channels_of(trace: Trace, axes: Sequence[str]) -> Array:
    """Return some axes of a run as (n, channels), each channel contiguous."""
    return np.stack([trace.axis(name) for name in axes]).T
