"""The largest ranges that are stated can be driven, and little more cannot."""

from collections.abc import Generator, Iterable
from typing import TypeVar

import pytest
from attrs import evolve

from afm_scan_ros.core.compensation import RESOLUTION, Compensation, largest_ranges, preflight
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import InverseSettings
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import total_samples
from helpers.in_process import ALL, default_model

Result = TypeVar("Result")
SMALL = ScanSpec(line_rate=20.0, lines=4, samples_per_line=400, preparation_cycles=2)


def result_of(search: Generator[str, None, Result]) -> Result:
    while True:
        try:
            next(search)
        except StopIteration as end:
            return end.value


def compensation(spec: ScanSpec, inverses: Iterable[str], voltage: float) -> Compensation:
    limits = DriveLimits(voltage, 2e5)
    return Compensation(default_model(), spec.sample_period, inverses, InverseSettings(), limits)


def drivable(compensation: Compensation, spec: ScanSpec) -> bool:
    try:
        result_of(preflight(compensation, spec, total_samples(spec)))
    except ScanError:
        return False
    return True


@pytest.mark.parametrize("pattern", ["raster", "sinusoidal", "lissajous"])
@pytest.mark.parametrize("voltage", [4.5, 50.0])
@pytest.mark.parametrize("inverses", [ALL, ()])
def test_the_largest_ranges_are_the_largest(
    pattern: str, voltage: float, inverses: Iterable[str]
) -> None:
    asked = evolve(SMALL, pattern=pattern, range_x=900e-6, range_y=900e-6)
    inverse = compensation(asked, inverses, voltage)
    found = result_of(largest_ranges(inverse, asked, total_samples(asked)))
    reached = evolve(asked, range_x=found["x"], range_y=found["y"])
    assert drivable(inverse, reached)
    for name in ("range_x", "range_y"):
        more = (1.0 + 2.0 * RESOLUTION) * getattr(reached, name)
        assert not drivable(inverse, evolve(reached, **{name: more}))


def test_an_axis_that_can_be_driven_keeps_its_range() -> None:
    asked = evolve(SMALL, range_x=20e-6, range_y=900e-6)
    inverse = compensation(asked, ALL, 5.0)
    found = result_of(largest_ranges(inverse, asked, total_samples(asked)))
    assert found["x"] == 20e-6
    assert 20e-6 < found["y"] < 120e-6


def test_a_preparation_that_goes_beyond_leaves_no_range() -> None:
    asked = evolve(SMALL, range_x=20e-6, range_y=20e-6)
    inverse = compensation(asked, ALL, 0.5)
    assert result_of(largest_ranges(inverse, asked, total_samples(asked))) == {}


def test_later_samples_count_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the search saw the preparation alone, the ranges still hold for the whole scan."""
    monkeypatch.setattr("afm_scan_ros.core.compensation.SEARCHED", 100)
    asked = evolve(SMALL, range_x=100e-6, range_y=100e-6)
    inverse = compensation(asked, ALL, 5.0)
    found = result_of(largest_ranges(inverse, asked, total_samples(asked)))
    assert drivable(inverse, evolve(asked, range_x=found["x"], range_y=found["y"]))
