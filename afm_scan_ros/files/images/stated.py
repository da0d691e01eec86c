"""What files of formats without a place for it state of a scan, as words beside the values."""

from collections.abc import Mapping
from pathlib import Path

from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.imaging.scan_image import ScanImage
from afm_scan_ros.files.images.found import ScanFacts

LINE_TIME, SLOW_DIRECTION, OVERSCAN = "line_time_s", "slow_direction", "overscan"
UPWARD = {"up": True, "down": False}


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
