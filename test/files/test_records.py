"""Records are made of mappings that people wrote, or refused with the mend."""

import pytest
from attrs import evolve, field, frozen
from attrs.validators import gt
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.scan_spec import PATTERNS, ScanSpec
from afm_scan_ros.files.records import from_mapping, to_mapping


@frozen
class Mode:
    frequency: float = field(metadata={"suffix": "_hz"}, validator=gt(0.0))
    damping: float


@frozen
class Plant:
    modes: tuple[Mode, ...]
    limits: tuple[float, float] = field(metadata={"suffix": "_mv", "scale": 1e-3})
    seed: int = 1
    name: str = "default"
    creeps: bool = True


GOOD = {"modes": [{"frequency_hz": 450.0, "damping": 0.02}], "limits_mv": [-4.0, 5.0]}


def test_numbers_become_si_and_the_rest_stays() -> None:
    assert from_mapping(Plant, GOOD, "f") == Plant((Mode(450.0, 0.02),), (-4e-3, 5e-3))


BAD = [
    ({"modes": 3.0}, "modes = 3.0 should be a list"),
    ({"modes": [{"frequency_hz": 450.0}]}, r"modes\[0\]: key 'damping' is missing; add it"),
    ({"modes": [{"frequency": 4.5, "damping": 1.0}]}, "did you mean 'frequency_hz'"),
    ({"modes": [{"frequency_hz": -4.5, "damping": 1.0}]}, "frequency_hz = -4.5 is out of range"),
    ({"modes": [4.5]}, r"modes\[0\]: expected 'key: value' lines, found 4.5"),
    ({"limits_mv": [1.0]}, "limits_mv has 1 entries, not 2"),
    ({"limits_mv": [1.0, float("nan")]}, r"limits_mv\[1\] = nan is not finite"),
    ({"limits_mv": [1.0, float("inf")]}, r"limits_mv\[1\] = inf is not finite"),
    ({"limits_mv": [1.0, 2]}, r"limits_mv\[1\] = 2 should be a number with a point"),
    ({"limits": [1.0, 2.0]}, "unknown key 'limits'; did you mean 'limits_mv'"),
    ({"seed": 1.0}, "seed = 1.0 should be a whole number"),
    ({"seed": True}, "seed = True should be a whole number"),
    ({"name": False}, "name = False should be text"),
    ({"creeps": 1}, "creeps = 1 should be true or false"),
    ({"qqqqqq": 1}, "unknown key 'qqqqqq'; known keys: modes, limits_mv, seed, name, creeps"),
]


@pytest.mark.parametrize(("change", "reason"), BAD)
def test_what_is_wrong_is_named(change: dict[str, object], reason: str) -> None:
    with pytest.raises(InputError, match=reason) as refusal:
        from_mapping(Plant, GOOD | change, "plant.yaml: x")
    assert str(refusal.value).startswith("plant.yaml: x: ")
    assert "\n" not in str(refusal.value)


def test_what_the_record_itself_refuses_is_reported_with_the_file() -> None:
    with pytest.raises(InputError, match=r"^scan.yaml: samples_per_line = 9 is odd"):
        from_mapping(ScanSpec, {"samples_per_line": 9}, "scan.yaml")


micrometres = st.decimals("0.001", "100", places=3).map(lambda d: float(d) * 1e-6)
specs = st.builds(
    evolve,
    st.just(ScanSpec()),
    pattern=st.sampled_from(PATTERNS),
    range_x=micrometres,
    range_y=micrometres,
    line_rate=st.floats(1.0, 50.0),
    lines=st.integers(2, 4096),
    samples_per_line=st.integers(10**3, 10**5).map(lambda n: 2 * n),
)


@given(specs)
def test_a_spec_comes_back_from_its_mapping(spec: ScanSpec) -> None:
    mapping = to_mapping(spec)
    again = from_mapping(ScanSpec, mapping, "again")
    assert to_mapping(again) == mapping
    assert again.range_x == pytest.approx(spec.range_x, rel=1e-14, abs=0.0)
    assert again.line_rate == spec.line_rate
