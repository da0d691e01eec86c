"""A driver in its own process answers as it would here, and ramps down when it should."""

import os
import re
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import DriverChoice, client
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.drivers.link import DriverTimeouts, Link, Message, ramp_bound
from afm_scan_ros.drivers.process import take_priority
from afm_scan_ros.drivers.safety import SafetySettings
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.stage import settings

PLANT = share_directory() / "config/plant.yaml"
METRES = settings()
PERIOD = 1e-4
PATIENCE = 60.0
SILENCE = 0.5
REST = SafetySettings().rest
LATE = 1.0  # s, that the machine may take to let a process run, and to end it
HUNG = r"the driver has not answered for"
KILLED = "a call of the driver did not return in time, and its process was ended"
RAMPED = r"drive ramped down to 0 V within 0\.\d+ s$"

Open = Callable[..., DriverProcess]


@pytest.fixture
def outputs(tmp_path: Path) -> Callable[[], np.ndarray]:
    """Return a function that reads what the process recorded of its outputs."""
    return lambda: np.loadtxt(tmp_path / "outputs.txt", ndmin=2)


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Open]:
    """Return a function that opens a driver; it is closed with the test."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    drivers: list[DriverProcess] = []

    def make(
        driver: str = "simulated",
        silence: float = PATIENCE,
        starved: float = PATIENCE,
        answer: float = PATIENCE,
        opening: float = PATIENCE,
        rest: float = REST,
        *,
        real_time: bool = False,
        **given: object,
    ) -> DriverProcess:
        options = {"plant_file": str(PLANT), "seed": 1, "output_log": str(tmp_path / "outputs.txt")}
        choice = DriverChoice(driver, METRES, options | given, "stage.yaml")
        waits = DriverTimeouts(silence, starved, opening, answer, real_time, rest)
        drivers.append(DriverProcess(choice, waits).opened())
        drivers[-1].start(PERIOD)
        assert drivers[-1].answer(PATIENCE) is None
        assert not drivers[-1].waiting
        return drivers[-1]

    yield make
    for driver in drivers:
        driver.close()


def drive(first: int, count: int, volts: float = 2.0) -> Trace:
    x = np.linspace(0.0, volts, count)
    return Trace(first, PERIOD, x, -0.5 * x)


def show_life(driver: DriverProcess, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        driver.show_life()
        time.sleep(0.01)


def until_ended(driver: DriverProcess) -> str:
    """Return the error with which a driver ends, and says nothing more."""
    with pytest.raises(ScanError) as raised:
        driver.answer(PATIENCE)
    return str(raised.value)


def test_it_answers_as_the_scanner_does_here(opened: Open) -> None:
    driver = opened()
    here = Piezoscanner(load_plant(PLANT), PERIOD, seed=1)
    rng = np.random.default_rng(1)
    first = 0
    for count in (1, 2, 500, 10_000, 7):
        x, y = 1e-3 * rng.standard_normal((2, count))
        block = Trace(first, PERIOD, x, y)
        driver.advance(block, last=False)
        assert driver.waiting
        answer = driver.answer(PATIENCE)
        assert answer is not None
        assert answer.true is not None
        for there, expected in zip(
            (answer.measured, answer.true), here.advance(block), strict=True
        ):
            assert (there.first_sample, there.sample_period) == (first, PERIOD)
            np.testing.assert_array_equal(there.x, expected.x)
            np.testing.assert_array_equal(there.y, expected.y)
        first += count


def test_a_driver_may_know_no_true_displacement(opened: Open) -> None:
    driver = opened("faulty:Real")
    driver.advance(drive(0, 10), last=False)
    answer = driver.answer(PATIENCE)
    assert answer is not None
    assert answer.true is None
    assert answer.measured.x.shape == (10,)


def test_silence_ends_in_the_ramp(opened: Open, outputs: Callable[[], np.ndarray]) -> None:
    driver = opened(silence=SILENCE)
    driver.advance(drive(0, 1000), last=False)
    assert driver.answer(PATIENCE) is not None
    said = until_ended(driver)
    assert said.startswith("the node has been silent for 0.5 s; ")
    driven, rest = outputs()
    np.testing.assert_array_equal(driven[2:], [2.0, -1.0])
    np.testing.assert_array_equal(rest[2:], [0.0, 0.0])
    assert rest[0] - driven[0] >= SILENCE
    with pytest.raises(ScanError, match=RAMPED):
        driver.advance(drive(1000, 5), last=False)


def test_no_sign_of_life_is_asked_for_before_the_first_block(opened: Open) -> None:
    driver = opened(silence=SILENCE)
    time.sleep(4 * SILENCE)
    driver.advance(drive(0, 10), last=False)
    assert driver.answer(PATIENCE) is not None


def test_a_sign_of_life_is_enough(opened: Open) -> None:
    driver = opened(silence=2.0)
    driver.advance(drive(0, 10), last=False)
    assert driver.answer(PATIENCE) is not None
    show_life(driver, 5.0)
    assert driver.outcome is None


@pytest.mark.parametrize("kind", ["simulated", "faulty:Slow"])
def test_drive_that_does_not_come_ends_in_the_ramp_though_the_node_lives(
    opened: Open, outputs: Callable[[], np.ndarray], kind: str
) -> None:
    driver = opened(kind, starved=SILENCE)
    driver.advance(drive(0, 1000), last=False)
    assert driver.answer(PATIENCE) is not None
    with pytest.raises(ScanError, match=rf"^no drive for 0\.5 s, at sample 1000; {RAMPED}"):
        show_life(driver, PATIENCE)
    driven, rest = outputs()
    np.testing.assert_array_equal(rest[2:], [0.0, 0.0])
    assert rest[0] - driven[0] >= SILENCE


def test_drive_is_due_once_the_last_block_has_been_output(opened: Open) -> None:
    driver = opened(starved=SILENCE)
    for first, last in ((0, False), (10_000, True)):  # 1 s each, simulated at once
        driver.advance(drive(first, 10_000, volts=0.0), last=last)
        assert driver.answer(PATIENCE) is not None
        show_life(driver, 1.0)


def test_no_drive_is_due_before_the_first_block_and_after_the_last(opened: Open) -> None:
    driver = opened(starved=SILENCE)
    for first in (0, 10):
        show_life(driver, 4 * SILENCE)
        driver.advance(drive(first, 10, volts=0.0), last=True)
        assert driver.answer(PATIENCE) is not None


def test_the_time_that_a_driver_works_is_no_silence(opened: Open) -> None:
    driver = opened("faulty:Slow", silence=SILENCE, starved=SILENCE)
    for first in (0, 10):
        driver.advance(drive(first, 10), last=False)
        driver.show_life()  # which nobody reads yet
        assert driver.answer(PATIENCE) is not None
    assert driver.outcome is None


def hung(driver: DriverProcess) -> str:
    """Let a driver hang in its second block; return the error, which comes in time."""
    driver.advance(drive(0, 1000), last=False)
    assert driver.answer(PATIENCE) is not None
    begun = time.monotonic()
    driver.advance(drive(1000, 1000), last=False)
    try:
        while True:  # as the node waits
            assert driver.answer(0.01) is None
    except ScanError as error:
        assert 0.1 + SILENCE <= time.monotonic() - begun < 0.1 + SILENCE + LATE
        return str(error)


@pytest.mark.parametrize("locked", [False, True])
def test_a_driver_that_hangs_is_named_and_ended(opened: Open, *, locked: bool) -> None:
    driver = opened("faulty:Hanging", answer=SILENCE, call="advance", locked=locked)
    said = hung(driver)
    assert re.match(HUNG, said)
    begun = time.monotonic()
    assert driver.ramp_down(said) == f"{said}; {KILLED}; the drive may not be at rest"
    driver.close()
    assert time.monotonic() - begun < REST + LATE


@pytest.mark.parametrize("locked", [False, True])
def test_a_block_that_is_late_is_followed_by_the_ramp(
    opened: Open, outputs: Callable[[], np.ndarray], *, locked: bool
) -> None:
    late = {"call": "advance", "seconds": 2, "locked": locked}
    driver = opened("faulty:Hanging", answer=SILENCE, **late)
    took = r"advance of the driver took 2\S* s, and may take 0\.6 s"
    assert re.fullmatch(f"{took}; {RAMPED}", driver.ramp_down(hung(driver)))
    driven, late_one, rest = outputs()[:, 2]
    assert (driven, late_one, rest) == (2.0, 2.0, 0.0)
    assert driver.close() == ""


@pytest.mark.parametrize("call", ["__init__", "start"])
def test_a_driver_that_opens_or_starts_late_ends_in_order(opened: Open, call: str) -> None:
    said = rf"^{call} of the driver took \S+ s, and may take 4.5 s$"
    with pytest.raises(ScanError, match=rf"{said}|{HUNG}|did not open within 4.5 s") as raised:
        opened("faulty:Hanging", opening=4.5, call=call, seconds=5)
    assert "may not be at rest" not in str(raised.value)


def test_one_that_may_be_ramped_down_while_it_hangs_is(
    opened: Open, outputs: Callable[[], np.ndarray]
) -> None:
    driver = opened("faulty:RampsMeanwhile", answer=SILENCE, call="advance")
    assert re.fullmatch(rf"{HUNG} 0\.6 s; {RAMPED}", driver.ramp_down(hung(driver)))
    np.testing.assert_array_equal(outputs()[-1, 2:], [0.0, 0.0])


def test_a_hang_before_the_first_block_leaves_no_process(opened: Open) -> None:
    with pytest.raises(ScanError, match=f"^({KILLED}|the driver did not open within 4.5 s)$"):
        opened("faulty:Hanging", opening=4.5, call="start", locked=True)


def test_a_ramp_that_hangs_is_named_and_ended(opened: Open) -> None:
    driver = opened("faulty:Hanging", rest=SILENCE, call="ramp_down", locked=True)
    driver.advance(drive(0, 10), last=False)
    assert driver.answer(PATIENCE) is not None
    said = driver.ramp_down("interrupted")
    ended = f"interrupted; {KILLED}"  # where the process is ended before the wait for its word is
    waited = "interrupted; the driver has not said that the drive is at rest"
    assert said in {waited, ended, f"{ended}; the drive may not be at rest"}
    driver.close()


def test_it_is_ramped_down_once(opened: Open, outputs: Callable[[], np.ndarray]) -> None:
    driver = opened()
    driver.advance(drive(0, 500), last=False)
    first = driver.ramp_down("interrupted")  # with a block that is still open
    assert first.startswith("interrupted; drive ramped down to 0 V within 0.0")
    assert driver.ramp_down("again") == driver.outcome == first
    np.testing.assert_array_equal(outputs()[-1, 2:], [0.0, 0.0])
    assert len(outputs()) == 2


def test_what_has_not_moved_is_not_said_to_be_ramped_down(opened: Open) -> None:
    assert opened().ramp_down("interrupted") == "interrupted"


def test_an_error_of_the_scanner_is_named(opened: Open) -> None:
    driver = opened()
    driver.advance(drive(0, 500, volts=6.0), last=False)
    assert "is beyond the amplifier's 5: scan a smaller range" in until_ended(driver)


def test_a_driver_that_is_killed_is_not_said_to_be_at_rest(opened: Open) -> None:
    driver = opened("faulty:Killed")
    driver.advance(drive(0, 500), last=False)
    said = "the driver's process was killed by SIGKILL; the drive may not be at rest"
    assert until_ended(driver) == said
    assert driver.ramp_down("interrupted") == said


def test_one_that_cannot_ramp_down_says_so(opened: Open) -> None:
    for kind, said in (
        ("NeverAtRest", r"OSError: no amplifier \(faulty\.py, line \d+\)"),
        ("Exits", r"SystemExit: no amplifier \(faulty\.py, line \d+\)"),
        ("SaysNothing", "ramp_down returned None, and not its duration in s"),
    ):
        driver = opened(f"faulty:{kind}")
        driver.advance(drive(0, 500), last=False)
        expected = rf"interrupted; the ramp-down failed \({said}\): the drive may not be at rest"
        assert re.fullmatch(expected, driver.ramp_down("interrupted"))
        assert driver.close() == driver.outcome


def test_an_error_is_one_line_without_control_characters(
    opened: Open, capfd: pytest.CaptureFixture[str]
) -> None:
    driver = opened("faulty:Loud")
    driver.advance(drive(0, 10), last=False)
    said = r"no card\n[INFO] the drive is at rest\x1b[2J\r; drive ramped down to 0 V within "
    assert until_ended(driver).startswith(said)
    with pytest.raises(InputError, match=r"^driver faulty:LoudlyClosed: no card \[INFO\] ready$"):
        opened("faulty:LoudlyClosed")
    assert "\n[INFO]" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("driver", "settings", "said"),
    [
        ("simulated", {"plant_file": "nowhere.yaml"}, "nowhere.yaml"),
        ("simulated", {"seeds": 2}, "stage.yaml: options: unknown key 'seeds'; did you mean"),
        ("simulated", {"seed": 2.0}, r"stage.yaml: options: seed = 2.0 should be a whole number"),
        ("nowhere:Driver", {}, "driver nowhere:Driver: No module named 'nowhere'; give module"),
        ("faulty", {}, r"driver faulty: \S+/faulty\.py has no such driver; give module:Class"),
        ("faulty:SLOW", {}, "has no such driver"),
        ("faulty:NoCard", {}, "^driver faulty:NoCard: no card dev0$"),
        ("faulty:Wordless", {}, "^driver faulty:Wordless: ConnectionError$"),
        ("faulty:NoKey", {}, "^driver faulty:NoKey: KeyError: 'dev0'$"),
    ],
)
def test_what_cannot_be_opened_is_refused(
    opened: Open, driver: str, settings: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        opened(driver, **settings)


@given(
    rows=st.integers(0, 4),
    count=st.integers(0, 3000),
    value=st.floats(allow_nan=False),
)
def test_what_is_sent_is_received(rows: int, count: int, value: float) -> None:
    here, there = socketpair()
    samples = np.full((rows, count), value) + np.arange(count)
    here.send(Message("drive", {"sample_period": value}, samples))
    received = there.receive()
    assert (received.kind, received.fields) == ("drive", {"sample_period": value})
    np.testing.assert_array_equal(received.samples, samples)
    here.close()
    with pytest.raises(EOFError):
        there.receive()
    there.close()


def socketpair() -> tuple[Link, Link]:
    one, other = (Link(end) for end in socket.socketpair())
    return one, other


def test_a_closed_driver_is_at_rest_or_it_is_named(opened: Open) -> None:
    failed = "the scan has ended; the ramp-down failed (OSError: no amplifier"
    for kind, said in (("simulated", ""), ("faulty:NeverAtRest", failed)):
        driver = opened(kind)
        driver.advance(drive(0, 1000), last=True)
        assert driver.answer(PATIENCE) is not None
        assert driver.close()[: len(failed)] == said


def test_the_ramp_does_not_depend_on_the_log(
    opened: Open, outputs: Callable[[], np.ndarray]
) -> None:
    driver = opened("faulty:Unlogged")
    driver.advance(drive(0, 1000), last=False)
    assert driver.answer(PATIENCE) is not None
    driver.advance(drive(1000, 10), last=False)
    expected = rf"RuntimeError: injected \(faulty.py, line \d+\); {RAMPED}"
    assert re.fullmatch(expected, until_ended(driver))
    np.testing.assert_array_equal(outputs()[-1, 2:], [0.0, 0.0])


@given(st.floats(0.0, 100.0))
def test_a_ramp_may_begin_after_the_buffer(late: float) -> None:
    """The buffer and as many readings may be due before it."""
    assert ramp_bound(METRES, late, REST) >= 2.0 * late + METRES.amplifier.longest_ramp


def test_readings_in_single_precision_arrive_as_they_are(opened: Open) -> None:
    driver = opened("faulty:Single")
    here = Piezoscanner(load_plant(PLANT), PERIOD, seed=1)
    for first, count in ((0, 1), (1, 4), (5, 501), (506, 2)):
        block = drive(first, count, volts=1e-3)
        driver.advance(block, last=False)
        answer = driver.answer(PATIENCE)
        assert answer is not None
        assert answer.true is not None
        for there, expected in zip(
            (answer.measured, answer.true), here.advance(block), strict=True
        ):
            assert there.first_sample == first
            np.testing.assert_array_equal(there.x, np.float32(expected.x))
            np.testing.assert_array_equal(there.y, np.float32(expected.y))
    assert driver.ramp_down("interrupted").startswith("interrupted; drive ramped down")


def test_a_module_of_the_folder_is_a_driver_and_nothing_else(
    opened: Open, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "subprocess", subprocess)  # a process of its own, not a fork
    monkeypatch.chdir(tmp_path)
    for name in ("numpy", "scipy", "attrs", "numba", "json", "afm_scan_ros"):
        (tmp_path / f"{name}.py").write_text("raise RuntimeError('poisoned')\n", "utf-8")
    (tmp_path / "lab.py").write_text(
        "from afm_scan_ros.drivers.simulated import SimulatedScanner as Stage\n", "utf-8"
    )
    for name in ("simulated", "lab:Stage"):
        driver = opened(name)
        driver.advance(drive(0, 10), last=True)
        assert driver.answer(PATIENCE) is not None
        assert driver.close() == ""


@pytest.mark.parametrize("real_time", [False, True])
def test_the_priority_is_as_it_is_said(opened: Open, tmp_path: Path, *, real_time: bool) -> None:
    driver = opened("faulty:Hanging", call="", real_time=real_time)
    pid = int((tmp_path / "outputs.txt.pid").read_text("utf-8"))
    raised = os.sched_getscheduler(pid) == os.SCHED_FIFO
    assert driver.priority.startswith("real-time priority 10" if raised else "no real-time prio")
    assert real_time or not raised


def test_a_priority_that_is_not_allowed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(os, "sched_setscheduler", mock.Mock(side_effect=PermissionError(1, "denied")))
        assert take_priority() == "no real-time priority: [Errno 1] denied"
        patch.delattr(os, "sched_setscheduler")
        assert "has no attribute 'sched_setscheduler'" in take_priority()
