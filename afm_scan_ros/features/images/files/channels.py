"""Channels of images in one form for all formats: as files hold them, and as they are written.

Formats without a place for the time, direction and overscan of a scan have them as words beside the
values.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import count
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import gt

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array
from afm_scan_ros.features.images.scan_image import ScanImage, refuse_gaps
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

    ``overscan`` is a share of the range at each end, ``angle`` (degrees) is from the scanner's x to
    the lines, and ``trace_share`` that of the trace in ``line_time``, where it is not half. None
    stands for what a file does not state.
    """

    range_x: float
    range_y: float
    line_time: float | None = None
    upward: bool | None = None
    overscan: float | None = None
    angle: float = 0.0
    trace_share: float | None = None


@frozen(eq=False)
class Direction:
    """One direction of one channel as a file holds it; ``back`` marks the retrace.

    Row 0 of ``values`` (lines, pixels) has the lowest y, column 0 the lowest x, also in a retrace.
    """

    name: str
    back: bool
    unit: str
    facts: ScanFacts
    values: Array


Sides = dict[bool, Direction]
"""Trace and retrace of one channel, by ``back``, as far as a file holds them."""


def split_title(title: str) -> tuple[str, bool]:
    """Return a title without its direction, and whether that is the retrace.

    A title that states no direction is a trace.
    """
    end = DIRECTION.search(title)
    name = "" if end is None else title[: end.start()].rstrip(OPENING)
    return (title, False) if end is None or not name else (name, end["back"] is not None)


def paired(found: Iterable[Direction]) -> dict[str, Sides]:
    """Put trace and retrace together by the names of their channels.

    A name that comes again in one direction is another channel, whose name has a number.
    """
    pairs: dict[str, Sides] = {}
    for each in found:
        names = (each.name if number == 1 else f"{each.name} ({number})" for number in count(1))
        name = next(name for name in names if each.back not in pairs.get(name, {}))
        pairs.setdefault(name, {})[each.back] = evolve(each, name=name)
    return pairs


def chosen(channels: Mapping[str, Sides], wanted: str | None) -> Sides:
    """Return a channel by its name, whatever the case of its letters; else that of the height.

    Where several hold the height, the first with both directions is taken; an only channel is
    taken whatever its name. Raises InputError naming the channels that are there.
    """
    names = ", ".join(f"'{name}'" for name in channels)
    if wanted is not None:
        for name, sides in channels.items():
            if name.lower() == wanted.lower():
                return sides
        raise InputError(f"no channel '{wanted}': give one of {names or 'none'}")
    lengths = {name: sides for name, sides in channels.items() if _is_length(_unit(sides))}
    heights = [sides for name, sides in lengths.items() if HEIGHT.search(name)]
    if not heights and len(channels) != 1:
        raise InputError(f"no channel is named as a height in m: give one of {names or 'none'}")
    return max(heights or channels.values(), key=lambda sides: (False in sides, len(sides)))


def _unit(sides: Sides) -> str:
    return (sides[False] if False in sides else sides[True]).unit


def image_of(path: Path, sides: Sides) -> ScanImage:
    """Return the image of a channel, lengths in m; raises InputError where its trace is missing."""
    if False not in sides:
        raise InputError(
            f"{path}: holds only the retrace of '{sides[True].name}': save its trace as well"
        )
    trace, retrace = sides[False], sides.get(True)
    facts = trace.facts
    return ScanImage(
        _in_si(trace),
        None if retrace is None else _in_si(retrace),
        facts.range_x,
        facts.range_y,
        facts.line_time,
        upward=facts.upward is not False,
        overscan=facts.overscan or 0.0,
        channel=trace.name,
        unit=METRE if _is_length(trace.unit) else trace.unit,
        name=str(path),
        assumptions=tuple(f"{path}: {each}" for each in _assumptions(facts, len(trace.values))),
    )


def _assumptions(facts: ScanFacts, lines: int) -> Iterator[str]:
    """Say what is taken for what a file does not state, and what it states that is not used.

    A rotation matters where a line passes into the next one by it: both axes of the scanner then
    move along a line.
    """
    if facts.upward is None:
        yield "states no slow direction: it is taken as scanned upward"
    if facts.overscan is None:
        yield "states no overscan: it is taken as none"
    along, across = np.cos(np.radians(facts.angle)), np.sin(np.radians(facts.angle))
    if along < 0.0 or abs(across) * facts.range_x * lines > facts.range_y:
        yield (
            f"its lines are rotated by {facts.angle:g}° from the scanner's x: x and y are taken"
            " along and across the lines, not as the scanner's axes"
        )
    if facts.trace_share is not None:
        yield (
            f"its trace takes {100.0 * facts.trace_share:.3g} % of the time of a line, its retrace"
            " the rest: both are taken as equally long"
        )


def _in_si(side: Direction) -> Array:
    return np.multiply(side.values, METRES.get(in_ascii(side.unit), 1.0))


def _is_length(unit: str) -> bool:
    return in_ascii(unit) in METRES


def metres(what: str, value: float, unit: str) -> float:
    """Return a length in m; raises InputError for a unit that is none of length."""
    if not _is_length(unit):
        raise InputError(f"{what} is in '{unit}', not in a unit of length: save it in m")
    return value * METRES[in_ascii(unit)]


def facts_of(range_x: float, range_y: float, stated: Mapping[str, str]) -> ScanFacts:
    """Return what words state of a scan; raises InputError for no number, or no direction."""
    direction = stated.get(SLOW_DIRECTION)
    if direction is not None and direction not in UPWARD:
        raise InputError(f"{SLOW_DIRECTION} is '{direction}': state up or down")
    numbers: dict[str, float] = {}
    for key in (LINE_TIME, OVERSCAN):
        try:
            numbers |= {key: float(stated[key])} if key in stated else {}
        except ValueError:
            raise InputError(f"{key} is '{stated[key]}': state a number") from None
    upward = None if direction is None else UPWARD[direction]
    return ScanFacts(range_x, range_y, numbers.get(LINE_TIME), upward, numbers.get(OVERSCAN))


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
        refuse_gaps(f"{self.title}:", self.values)

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
