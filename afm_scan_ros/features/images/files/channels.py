"""Channels of images in one form for all formats: as files hold them, and as they are written.

Formats without a place for the time, direction and overscan of a scan have them as words beside the
values.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.scan_image import ScanImage
from afm_scan_ros.files.units import METRES, in_ascii

HEIGHT = re.compile(r"topo|height|z.?axis|z.?sensor|^z\b", re.IGNORECASE)
"""Names of channels that hold the height."""
DIRECTION = re.compile(
    r"(?:(?P<back>retrace+|backward|bwd)|trace+|forward|fwd)[\s\])]*$", re.IGNORECASE
)
"""End of a title that states the direction, as in ``HeightRetrace`` or ``Z (Backward)``."""
OPENING = " \t[(_-"
"""What may stand between a name and its direction."""
METRE = "m"
LINE_TIME, SLOW_DIRECTION, OVERSCAN = "line_time_s", "slow_direction", "overscan"
UPWARD = {"up": True, "down": False}


@frozen
class ScanFacts:
    """How a channel was scanned: ranges in m, the time of trace and retrace together in s.

    ``overscan`` is a share of the range at each end. None stands for what a file does not state.
    """

    range_x: float
    range_y: float
    line_time: float | None = None
    upward: bool | None = None
    overscan: float | None = None


@frozen(eq=False)
class FoundChannel:
    """A channel: row 0 of both arrays has the lowest y, column 0 the lowest x.

    Both are of shape (lines, pixels), None where the file does not hold that direction.
    """

    name: str
    unit: str
    facts: ScanFacts
    trace: Array | None
    retrace: Array | None


@frozen(eq=False)
class Direction:
    """One direction of one channel as a file lists them, with the title that it has there."""

    title: str
    unit: str
    facts: ScanFacts
    values: Array


def paired(found: Iterable[Direction]) -> list[FoundChannel]:
    """Put trace and retrace of the same channel together, by their titles.

    A title that states no direction is a trace. A title that comes again is another channel.
    """
    pairs: dict[str, dict[bool, Direction]] = {}
    for each in found:
        name, back = split_title(each.title)
        number = 1
        while back in pairs.get(_numbered(name, number), {}):
            number += 1
        pairs.setdefault(_numbered(name, number), {})[back] = each
    return [_channel(name, sides) for name, sides in pairs.items()]


def split_title(title: str) -> tuple[str, bool]:
    """Return a title without its direction, and whether that is the retrace."""
    end = DIRECTION.search(title)
    name = "" if end is None else title[: end.start()].rstrip(OPENING)
    return (title, False) if end is None or not name else (name, end["back"] is not None)


def _numbered(name: str, number: int) -> str:
    return name if number == 1 else f"{name} ({number})"


def _channel(name: str, sides: dict[bool, Direction]) -> FoundChannel:
    trace, retrace = sides.get(False), sides.get(True)
    one = trace or sides[True]
    return FoundChannel(
        name,
        one.unit,
        one.facts,
        None if trace is None else trace.values,
        None if retrace is None else retrace.values,
    )


def chosen(path: Path, channels: Sequence[FoundChannel], wanted: str | None) -> FoundChannel:
    """Return a channel by its name, whatever the case of its letters; else that of the height.

    Where several hold the height, the first with both directions is taken; an only channel is
    taken whatever its name. Raises InputError naming the channels that are there.
    """
    names = ", ".join(f"'{channel.name}'" for channel in channels)
    if wanted is not None:
        fitting = [each for each in channels if each.name.lower() == wanted.lower()]
        if not fitting:
            raise InputError(f"{path}: no channel '{wanted}': give one of {names or 'none'}")
        return fitting[0]
    heights = [each for each in channels if each.unit == METRE and HEIGHT.search(each.name)]
    both = [each for each in heights if each.trace is not None and each.retrace is not None]
    traces = [each for each in heights if each.trace is not None]
    for candidates in (both, traces, heights, channels if len(channels) == 1 else []):
        if candidates:
            return candidates[0]
    raise InputError(f"{path}: no channel is named as a height in m: give one of {names or 'none'}")


def image_of(path: Path, channel: FoundChannel) -> ScanImage:
    """Return the image of a channel; raises InputError where its trace is not in the file."""
    if channel.trace is None:
        raise InputError(
            f"{path}: holds only the retrace of '{channel.name}': save its trace as well"
        )
    facts = channel.facts
    return ScanImage(
        channel.trace,
        channel.retrace,
        facts.range_x,
        facts.range_y,
        facts.line_time,
        upward=facts.upward is not False,
        overscan=facts.overscan or 0.0,
        channel=channel.name,
        unit=channel.unit,
        name=str(path),
        assumptions=tuple(_assumptions(path, facts)),
    )


def _assumptions(path: Path, facts: ScanFacts) -> list[str]:
    found = []
    if facts.upward is None:
        found.append(f"{path}: states no slow direction: it is taken as scanned upward")
    if facts.overscan is None:
        found.append(f"{path}: states no overscan: it is taken as none")
    return found


def metres(path: Path, what: str, value: float, unit: str) -> float:
    """Return a length in m; raises InputError for a unit that is none of length."""
    if in_ascii(unit) not in METRES:
        raise InputError(f"{path}: {what} is in '{unit}', not in a unit of length: save it in m")
    return value * METRES[in_ascii(unit)]


def in_si(values: Array, unit: str) -> tuple[Array, str]:
    """Return lengths in m, and all other quantities as they are."""
    factor = METRES.get(in_ascii(unit))
    return (values, unit) if factor is None else (np.multiply(values, factor), METRE)


def facts_of(path: Path, facts: ScanFacts, stated: Mapping[str, str]) -> ScanFacts:
    """Add what is stated; raises InputError for what is no number, or no direction."""
    direction = stated.get(SLOW_DIRECTION)
    if direction is not None and direction not in UPWARD:
        raise InputError(f"{path}: {SLOW_DIRECTION} is '{direction}': state up or down")
    return evolve(
        facts,
        line_time=_number(path, LINE_TIME, stated),
        upward=None if direction is None else UPWARD[direction],
        overscan=_number(path, OVERSCAN, stated),
    )


def _number(path: Path, key: str, stated: Mapping[str, str]) -> float | None:
    try:
        return float(stated[key]) if key in stated else None
    except ValueError:
        raise InputError(f"{path}: {key} is '{stated[key]}': state a number") from None


def words_of(image: ScanImage) -> dict[str, str]:
    """Return what is stated of an image, as ``facts_of`` reads it."""
    found = {
        SLOW_DIRECTION: "up" if image.upward else "down",
        OVERSCAN: repr(float(image.overscan)),
    }
    return found if image.line_time is None else {**found, LINE_TIME: repr(float(image.line_time))}


@frozen(eq=False)
class ImageChannel:
    """One direction of one channel: ``values`` (lines, pixels) in ``unit``.

    Row 0 has the lowest y and column 0 the lowest x, also in a retrace. ``range_x`` and ``range_y``
    (m) hold all pixels, from ``left`` and ``bottom`` (m) on. ``direction`` is ``trace`` or
    ``retrace``, empty for what belongs to neither. Raises InputError for values that are no plane
    or not finite, and ValueError for ranges that are not positive.
    """

    name: str
    unit: str
    values: Array
    range_x: float = field(validator=gt(0.0))
    range_y: float = field(validator=gt(0.0))
    direction: str = ""
    left: float = 0.0
    bottom: float = 0.0

    def __attrs_post_init__(self) -> None:
        if self.values.ndim != 2 or not self.values.size:  # noqa: PLR2004 - a plane
            raise InputError(f"{self.title}: an image of shape {self.values.shape}: give a plane")
        if not np.all(np.isfinite(self.values)):
            line, pixel = (int(k) for k in np.argwhere(~np.isfinite(self.values))[0])
            raise InputError(
                f"{self.title}: not a finite number in line {line}, pixel {pixel}: give an image"
                " without gaps"
            )

    @property
    def title(self) -> str:
        """Name and direction, as ``Topography (trace)``."""
        return f"{self.name} ({self.direction})" if self.direction else self.name


def image_channels(image: ScanImage) -> tuple[ImageChannel, ...]:
    """Return the trace of an image, and its retrace where there is one."""
    sides = (("trace", image.trace), ("retrace", image.retrace))
    return tuple(
        ImageChannel(image.channel, image.unit, values, image.range_x, image.range_y, direction)
        for direction, values in sides
        if values is not None
    )
