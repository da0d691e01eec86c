"""Which channel of a file is read where none is named, and how directions are put together."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.files.images.channels import Direction, ScanFacts, chosen, image_of, paired

PATH = Path("scan.gwy")
FACTS = ScanFacts(2e-6, 1e-6, 0.5, upward=False, overscan=0.0)


def listed(*titles: str, units: Sequence[str] = ()) -> list[Direction]:
    """Return directions whose values are their numbers in the list."""
    every = [*units, *("m",) * (len(titles) - len(units))]
    return [
        Direction(title, unit, FACTS, np.full((8, 9), float(number)))
        for number, (title, unit) in enumerate(zip(titles, every, strict=True))
    ]


CHOICES = [
    (("Amplitude forward", "Z-Axis forward", "Z-Axis backward"), ("Z-Axis", 1, 2)),
    (("Height Sensor trace", "Height trace", "Height retrace"), ("Height", 1, 2)),
    (("ZSensorTrace", "HeightTrace", "HeightRetrace", "ZSensorRetrace"), ("ZSensor", 0, 3)),
    (("Phase", "Topography", "Height"), ("Topography", 1, None)),
    (("Height retrace", "Z trace"), ("Z", 1, None)),
    (("My channel",), ("My channel", 0, None)),
    (("Height trace", "Height trace", "Height retrace"), ("Height", 0, 2)),
]


@pytest.mark.parametrize(("titles", "expected"), CHOICES, ids=str)
def test_the_height_with_both_directions(
    titles: tuple[str, ...], expected: tuple[str, int, int | None]
) -> None:
    channel = chosen(PATH, paired(listed(*titles)), None)
    sides = [None if side is None else side[0, 0] for side in (channel.trace, channel.retrace)]
    assert (channel.name, *sides) == expected


def test_a_title_that_comes_again_is_another_channel() -> None:
    found = paired(listed("Z trace", "Z retrace", "Z retrace", "Z trace", "Z trace"))
    names = [(each.name, each.trace is not None, each.retrace is not None) for each in found]
    assert names == [("Z", True, True), ("Z (2)", True, True), ("Z (3)", True, False)]
    assert chosen(PATH, found, "z (2)").trace[0, 0] == 3


def test_a_height_in_another_unit_is_none() -> None:
    found = paired(listed("Height trace", "Phase trace", units=["V", "deg"]))
    with pytest.raises(InputError, match="named as a height in m: give one of 'Height', 'Phase'"):
        chosen(PATH, found, None)
    assert chosen(PATH, found, "Height").unit == "V"


def test_what_is_stated_of_the_scan() -> None:
    image = image_of(PATH, paired(listed("Height"))[0])
    facts = (image.range_x, image.range_y, image.line_time, image.upward, image.overscan)
    assert facts == (2e-6, 1e-6, 0.5, False, 0.0)
    assert (image.name, image.assumptions) == ("scan.gwy", ())
