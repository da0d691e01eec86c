"""Whatever arrays a driver returns, they are float64 at the samples of its drive, or refused."""

import math
import socket
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import Driver, Reading
from afm_scan_ros.drivers.guarded import GuardedDriver, checked
from afm_scan_ros.drivers.link import Link, Message
from helpers.stage import settings

FIRST, PERIOD = 40, 1e-4
REAL = np.typecodes["AllInteger"] + np.typecodes["Float"]
CODES = [order + code for code in np.typecodes["All"] for order in "<>"]


def drive(count: int) -> Trace:
    return Trace(FIRST, PERIOD, np.zeros(count), np.zeros(count))


def answered(x: object, count: int = 4, y: object = None) -> Trace:
    """Return what is made of a driver's readings."""
    rest = np.zeros(count) if y is None else y
    return checked(Reading(Trace(FIRST, PERIOD, x, rest)), drive(count), knows_true=False).sensor


def layouts(values: np.ndarray) -> list[np.ndarray]:
    """Return the same values as they may lie in memory."""
    backwards = values[::-1].copy()[::-1]
    column = np.stack([values, values], axis=1)[:, 0]
    read_only = values.copy()
    read_only.flags.writeable = False
    return [values, backwards, column, read_only, np.ma.masked_array(values)]


@pytest.mark.parametrize("code", CODES)
def test_every_kind_of_number_is_read_or_refused(code: str) -> None:
    dtype = np.dtype(code)
    values = np.zeros(4, dtype)
    if dtype.char not in REAL:
        with pytest.raises(ScanError, match=r"^sample 40, axis x: .*plain array of real numbers, "):
            answered(values)
        with pytest.raises(ScanError, match=r"^sample 40, axis y: .*plain array of real numbers, "):
            answered(np.zeros(4), y=values)
        return
    values[:] = [0, 1, 3, 100]
    for each in layouts(values):
        made = answered(each)
        assert made.x.dtype == np.float64
        assert made.x.dtype.isnative
        assert made.x.flags.c_contiguous
        np.testing.assert_array_equal(made.x, [0.0, 1.0, 3.0, 100.0])


@given(
    arrays.arrays(
        st.one_of(
            arrays.integer_dtypes(), arrays.unsigned_integer_dtypes(), arrays.floating_dtypes()
        ),
        st.integers(1, 50),
    )
)
def test_a_number_is_the_nearest_float64(values: np.ndarray) -> None:
    made = answered(values, values.size)
    np.testing.assert_array_equal(made.x, values.astype(np.float64))


def test_float64_is_not_copied() -> None:
    values = np.arange(4.0)
    assert answered(values).x is values


@given(arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3), st.integers(1, 9))
def test_another_shape_is_refused(shape: tuple[int, ...], count: int) -> None:
    if shape == (count,):
        return
    with pytest.raises(ScanError, match=r"^sample 40, axis x: .* must have that of the drive, \("):
        answered(np.zeros(shape), count)


class Volts(np.ndarray):
    """An array with a unit, as that of a library of quantities."""


@pytest.mark.parametrize("given", [[0.0] * 4, None, "abcd", 1.0, np.zeros(4).view(Volts)])
def test_what_is_no_plain_array_is_refused(given: object) -> None:
    with pytest.raises(ScanError, match=rf"plain array .* and not {type(given).__name__}"):
        answered(given)


@given(st.lists(st.booleans(), min_size=1, max_size=20).filter(any))
def test_a_masked_value_is_no_reading(mask: list[bool]) -> None:
    values = np.ma.masked_array(np.zeros(len(mask)), mask)
    said = rf"^sample {FIRST + mask.index(True)}, axis x: masked in the driver's readings"
    with pytest.raises(ScanError, match=said):
        answered(values, len(mask))


SAME = Trace(FIRST, PERIOD, np.zeros(4), np.zeros(4))


@pytest.mark.parametrize("period", [PERIOD, np.float32(PERIOD), 1.0 / round(1.0 / PERIOD)])
@pytest.mark.parametrize("first", [FIRST, np.int32(FIRST), float(FIRST)])
def test_the_samples_may_be_named_by_any_number(first: object, period: object) -> None:
    given = evolve(SAME, first_sample=first, sample_period=period)
    made = checked(Reading(given, given), drive(4), knows_true=True)
    for each in (made.sensor, made.true):
        assert each is not None
        assert (each.first_sample, each.sample_period) == (FIRST, PERIOD)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        *(({"first_sample": n}, "first_sample = .* is not that of") for n in (0, 41, None, "40")),
        *(
            ({"sample_period": n}, "sample_period = .* is not that of the drive, 0.0001$")
            for n in (1.0001e-4, 0.0, math.nan, math.inf, -1e-4, None, "1e-4")
        ),
        ({"x": np.zeros(3)}, r"of shape \(3,\), must have that of the drive, \(4,\)$"),
        ({"y": np.zeros(4, complex)}, "and not ndarray of complex128$"),
    ],
)
def test_other_samples_than_those_of_the_drive_are_refused(
    changed: dict[str, object], said: str
) -> None:
    other = evolve(SAME, **changed)
    with pytest.raises(ScanError, match=rf"^sample 40.*: the driver's readings.*{said}"):
        checked(Reading(other), drive(4), knows_true=False)
    with pytest.raises(ScanError, match=rf"^sample 40.*: the driver's true displacement.*{said}"):
        checked(Reading(SAME, other), drive(4), knows_true=True)


def test_a_true_displacement_is_there_where_it_is_said_to_be() -> None:
    with pytest.raises(ScanError, match="KNOWS_TRUE of the driver is True, but its Reading has no"):
        checked(Reading(SAME), drive(4), knows_true=True)
    with pytest.raises(ScanError, match="KNOWS_TRUE of the driver is False, but its Reading has a"):
        checked(Reading(SAME, SAME), drive(4), knows_true=False)
    with pytest.raises(ScanError, match="true displacement must be a Trace, and not ndarray"):
        checked(Reading(SAME, np.zeros(4)), drive(4), knows_true=True)  # type: ignore[arg-type]
    lost = evolve(SAME, y=np.array([0.0, 0.0, math.inf, math.nan]))
    with pytest.raises(ScanError, match=r"^sample 42, axis y: the true displacement is not finite"):
        checked(Reading(SAME, lost), drive(4), knows_true=True)


@given(
    st.lists(
        arrays.arrays(
            st.sampled_from([np.dtype(order + code) for code in REAL for order in "<>"]),
            arrays.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=20),
            elements={"min_value": 0, "max_value": 100},
        ),
        min_size=1,
        max_size=3,
    )
)
def test_messages_of_any_real_numbers_stay_apart(sent: list[np.ndarray]) -> None:
    one, other = (Link(end) for end in socket.socketpair())
    one.patience = other.patience = 10.0
    for place, samples in enumerate(sent):
        one.send(Message("moved", {"place": place}, samples.T))
    for place, samples in enumerate(sent):
        received = other.receive()
        assert received.fields == {"place": place}
        assert received.samples.dtype == np.float64
        np.testing.assert_array_equal(received.samples, samples.T)
    one.close()
    other.close()


@pytest.mark.parametrize("code", [code for code in CODES if code[1] not in REAL + "?"])
def test_of_other_samples_nothing_is_sent(code: str) -> None:
    one, other = (Link(end) for end in socket.socketpair())
    for samples in (np.zeros((2, 4), code), np.zeros(4), np.zeros((1, 2, 3))):
        with pytest.raises((TypeError, ValueError)):
            one.send(Message("moved", {}, samples))
    assert not other.readable(0.0)
    one.close()
    other.close()


class Says(Driver):
    """Says what the test wants, which is in ``taken`` and ``ahead``."""

    taken: object = 0.0
    ahead: object = 0

    def __init__(self, _: object) -> None:
        pass

    def buffered(self, sample_period: float) -> int:  # noqa: ARG002 - as the interface has it
        return self.ahead  # type: ignore[return-value] # what a lab may write

    def start(self, sample_period: float) -> None:
        pass

    def advance(self, drive: Trace) -> Reading:
        return Reading(drive)

    def ramp_down(self) -> float:
        return self.taken  # type: ignore[return-value] # what a lab may write


@pytest.fixture
def says(monkeypatch: pytest.MonkeyPatch) -> GuardedDriver:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setattr("afm_scan_ros.drivers.guarded.driver_class", lambda _: Says)
    return GuardedDriver("says", settings(), {}, "stage.yaml")


@pytest.mark.parametrize("taken", [0, 0.25, np.float32(0.25), np.int16(1), Fraction(1, 4)])
def test_a_ramp_may_take_any_duration(
    says: GuardedDriver, taken: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Says, "taken", taken)
    assert type(says.ramp_down()) is float
    assert says.ramp_down() == taken


@pytest.mark.parametrize(
    ("taken", "said"),
    [
        (math.nan, "nan"),
        (np.float64(math.nan), "nan"),
        (math.inf, "inf"),
        (-math.inf, "-inf"),
        (-0.1, "-0.1"),
        (None, "None"),
        (True, "True"),
        ("0.1", "'0.1'"),
        (1j, "1j"),
        ([0.1], r"\[0\.1\]"),
    ],
)
def test_a_ramp_without_a_duration_is_named(
    says: GuardedDriver, taken: object, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Says, "taken", taken)
    with pytest.raises(ScanError, match=f"^ramp_down returned {said}, and not its duration"):
        says.ramp_down()


@pytest.mark.parametrize("ahead", [-1, 0.5, None, math.nan])
def test_a_buffer_has_whole_samples(
    says: GuardedDriver, ahead: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Says, "ahead", ahead)
    with pytest.raises(InputError, match=r"^buffered of the driver returned .*, and not samples"):
        says.start(PERIOD)
