"""What is known of the base effects of one axis, and where it holds.

An effect that is unknown stands in the model as if it were absent: no creep, a hysteresis that is
a straight line, a vibration that is faster than the records could show.
"""

from collections.abc import Iterator
from enum import Enum

import numpy as np
from attrs import field, fields, frozen

from afm_scan_ros.core.errors import InputError

Range = tuple[float, float]
"""Least and greatest value."""


IDENTIFYING_KINDS = ("creep", "hysteresis", "frequency")
"""Kinds of record, of which each identifies an effect."""


class Status(Enum):
    """How an effect came into the model."""

    IDENTIFIED = "identified"
    ASSUMED = "assumed"
    UNKNOWN = "unknown"


@frozen
class ParameterInterval:
    """95 % interval of a parameter, in ``unit``; an open end is None."""

    name: str
    unit: str
    lower: float | None = None
    upper: float | None = None


def closed(name: str, interval: Range, unit: str) -> ParameterInterval:
    """Return an interval whose ends may be infinite as one whose ends may be open."""
    lower, upper = (float(end) if np.isfinite(end) else None for end in interval)
    return ParameterInterval(name, unit, lower, upper)


def _range(given: Range | None) -> Range | None:
    return None if given is None else (float(given[0]), float(given[1]))


@frozen
class EffectStatus:
    """How one effect is known, and over which drive (V), frequencies (Hz) and hold times (s).

    A range that is None is not stated. ``identifiable_from`` is the kind of record that would
    identify an effect that is unknown. Raises InputError for a range whose ends are exchanged, and
    for an unknown effect without such a record.
    """

    status: Status = field(default=Status.IDENTIFIED, converter=Status)
    drive: Range | None = field(default=None, converter=_range)
    frequencies: Range | None = field(default=None, converter=_range)
    hold_times: Range | None = field(default=None, converter=_range)
    intervals: tuple[ParameterInterval, ...] = ()
    identifiable_from: str = ""

    def __attrs_post_init__(self) -> None:
        for name in ("drive", "frequencies", "hold_times"):
            given = getattr(self, name)
            if given is not None and not given[0] <= given[1]:
                raise InputError(f"{name} {given}: give the smaller end first")
        if self.status is Status.UNKNOWN and self.identifiable_from not in IDENTIFYING_KINDS:
            raise InputError(
                f"identifiable_from is {self.identifiable_from!r}:"
                f" give one of {', '.join(IDENTIFYING_KINDS)}"
            )


@frozen
class BaseEffects:
    """Status of each base effect of one axis; a model that does not state it has identified all."""

    creep: EffectStatus = EffectStatus()
    hysteresis: EffectStatus = EffectStatus()
    vibration: EffectStatus = EffectStatus()

    def each(self) -> Iterator[tuple[str, EffectStatus]]:
        """Yield name and status of each effect."""
        for effect in fields(BaseEffects):
            yield effect.name, getattr(self, effect.name)

    def unknown(self) -> Iterator[tuple[str, EffectStatus]]:
        """Yield name and status of each effect that is unknown."""
        yield from (each for each in self.each() if each[1].status is Status.UNKNOWN)
