"""What is done around every driver: limits, unit, sign, latency, and a sensor that is judged."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import AmplifierSpec
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import (
    AxisSettings,
    Driver,
    Reading,
    ScannerSettings,
    driver_class,
    load_settings,
    open_driver,
    settings_file,
)
from afm_scan_ros.drivers.guarded import GuardedDriver, SensorWatch
from helpers.stage import settings as stage_settings

PERIOD = 1e-4
SENSOR = AxisSettings(sensor_scale=-8e-6, sensor_offset=0.25, sensor_low=-10.0, sensor_high=10.0)
METRES = stage_settings(response_time=0.01)
VOLTS = evolve(METRES, x=SENSOR, y=SENSOR)


@pytest.fixture(autouse=True)
def _faulty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


def drive(count: int = 2000, volts: float = 2.0) -> Trace:
    x = 0.5 * volts * (1.0 - np.cos(np.linspace(0.0, np.pi, count)))
    return Trace(0, PERIOD, x, -0.5 * x)


def moved(
    driver: str, given: ScannerSettings, whole: Trace, cuts: tuple[int, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Return the displacement of a drive that is given in blocks."""
    guarded = GuardedDriver(driver, given, {}, "stage.yaml")
    guarded.start(PERIOD)
    bounds = sorted({0, *cuts, whole.x.size})
    answers = []
    for start, stop in pairwise(bounds):
        block = Trace(start, PERIOD, whole.x[start:stop], whole.y[start:stop])
        answers.append(guarded.advance(block, last=stop == whole.x.size).measured)
        assert answers[-1].first_sample == sum(each.x.size for each in answers[:-1])
    return np.concatenate([a.x for a in answers]), np.concatenate([a.y for a in answers])


def test_volts_become_metres_with_scale_sign_and_offset() -> None:
    read, simulated = moved("faulty:Real", VOLTS, drive()), moved("simulated", METRES, drive())
    np.testing.assert_allclose(read, simulated, rtol=1e-12, atol=1e-18)


@settings(deadline=None, max_examples=10)
@given(st.sets(st.integers(1, 1999), max_size=6))
def test_a_late_reading_has_the_sample_of_its_displacement(cuts: set[int]) -> None:
    late = evolve(VOLTS, latency_samples=7)
    there = moved("faulty:Late", late, drive(), tuple(cuts))
    np.testing.assert_array_equal(there, moved("faulty:Real", VOLTS, drive()))


@pytest.mark.parametrize(
    ("driver", "said"),
    [
        ("LostCable", r"sample \d+, axis x: the sensor has read exactly 0\.25 V while the drive"),
        ("NotANumber", r"sample \d+, axis x: the sensor reads nan V; the sensor is lost"),
        ("Underrun", "underrun: a sample was not output in time"),
        ("NoReading", r"sample \d+: advance of the driver must return Reading\(Trace\("),
        ("BareReading", r"sample \d+: advance of the driver must return Reading\(Trace\("),
        ("ListReading", r"sample \d+, axis x: .* readings must be a plain array .* not list"),
    ],
)
@pytest.mark.parametrize("cuts", [(), (1, 700, 1400), tuple(range(1, 2000, 13))])
def test_a_fault_is_named(driver: str, said: str, cuts: tuple[int, ...]) -> None:
    with pytest.raises(ScanError, match=said):
        moved(f"faulty:{driver}", VOLTS, drive(), cuts)


def test_a_clipped_sensor_is_named() -> None:
    ends = evolve(SENSOR, sensor_low=-0.35, sensor_high=0.35)
    said = r"axis y: the sensor reads 0\.35 V, which is clipped at -0\.35 or 0\.35 V"
    with pytest.raises(ScanError, match=said):
        moved("faulty:Clipped", evolve(VOLTS, y=ends), drive())


def test_the_limits_of_the_settings_hold_before_the_driver_moves() -> None:
    low = evolve(VOLTS, amplifier=AmplifierSpec(1.0, 2e5, 40.0))
    with pytest.raises(ScanError, match=r"sample \d+, axis x: drive \[V\] = 1\.0\d* is beyond"):
        moved("faulty:Broken", low, drive())


class Answers:
    """A sensor's watch, with signals of one axis; the other rests with noise."""

    def __init__(self, **changed: object) -> None:
        self.watch = SensorWatch(evolve(VOLTS, **changed), PERIOD, latency=0)

    def take(self, volts: np.ndarray, read: np.ndarray, cuts: tuple[int, ...] = ()) -> None:
        noise = 1e-3 * np.random.default_rng(1).standard_normal(volts.size)
        bounds = sorted({0, *cuts, volts.size})
        for start, stop in pairwise(bounds):
            here = slice(start, stop)
            self.watch.check(
                Trace(start, PERIOD, volts[here], 0.0 * volts[here]),
                Trace(start, PERIOD, read[here], noise[here]),
            )


RAMP = np.repeat(np.arange(20), 100) * 0.01  # one window of the response time a step


def test_a_sensor_may_stand_still_while_the_drive_rests() -> None:
    Answers().take(np.full(5000, 3.0), np.full(5000, 0.3))


def test_a_change_of_the_drive_below_its_resolution_need_not_be_seen() -> None:
    Answers(drive_resolution=0.2).take(RAMP, np.full(2000, 0.3))
    with pytest.raises(ScanError, match="lost"):
        Answers(drive_resolution=0.1).take(RAMP, np.full(2000, 0.3))


def test_the_scanner_has_its_response_time_to_follow() -> None:
    volts = np.repeat([0.0, 2.0], [1000, 100])  # the step is in the last window
    Answers().take(volts, np.full(1100, 0.3))
    later = np.repeat([0.0, 2.0], [1000, 300])
    with pytest.raises(ScanError, match="lost"):
        Answers().take(later, np.full(1300, 0.3))


def test_one_other_reading_shows_that_the_sensor_lives() -> None:
    read = np.full(2000, 0.3)
    read[::500] += 1e-6
    Answers(drive_resolution=0.06).take(RAMP, read)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 1200), st.sets(st.integers(1, 1999), max_size=8))
def test_a_lost_sensor_is_found_at_the_same_sample_however_blocks_are_cut(
    lost: int, cuts: set[int]
) -> None:
    volts = np.linspace(0.0, 2.0, 2000)
    read = np.where(np.arange(2000) < lost, 0.1 * volts, 0.1 * volts[lost])
    said = []
    for each in (tuple(cuts), ()):
        with pytest.raises(ScanError) as raised:
            Answers().take(volts, read, each)
        said.append(str(raised.value))
    assert said[0] == said[1]


SETTINGS = """\
amplifier: {voltage_limit_v: 5.0, slew_limit_v_per_s: 2.0e5, ramp_down_slew_v_per_s: 40.0}
x: {sensor_scale_m_per_v: 8e-6, sensor_offset_v: 0.0, sensor_low_v: -10.0, sensor_high_v: 10.0}
y: {sensor_scale_m_per_v: 8e-6, sensor_offset_v: 0.0, sensor_low_v: -10.0, sensor_high_v: 10.0}
latency_samples: 0
response_time_s: 0.01
drive_resolution_v: 0.1
sampling_instant: before_update
options: {seed: 3}
"""


def test_the_simulated_scanner_alone_has_settings_by_default() -> None:
    moved("simulated", load_settings("simulated", settings_file("simulated", "")).settings, drive())
    assert settings_file("simulated", "own.yaml") == Path("own.yaml")
    with pytest.raises(InputError, match="driver nidaqmx: it has no settings by default: give a"):
        settings_file("nidaqmx", "")


def test_settings_are_read(tmp_path: Path) -> None:
    (path := tmp_path / "stage.yaml").write_text(SETTINGS, "utf-8")
    choice = load_settings("mylab:Stage", path)
    same = evolve(SENSOR, sensor_scale=8e-6, sensor_offset=0.0)
    assert choice.settings == evolve(VOLTS, x=same, y=same)
    assert (choice.driver, choice.options, choice.where) == ("mylab:Stage", {"seed": 3}, str(path))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("latency_samples: 0\n", "", "stage.yaml: key 'latency_samples' is missing; add it"),
        ("limit_v: 5.0", "limit_v: 0", "amplifier: voltage_limit_v = 0 is out of range"),
        ("latency_samples: 0", "latency_samples: -1", "latency_samples = -1 is out of range"),
        ("latency_samples: 0", "latency_samples: 0.5", "0.5 should be a whole number"),
        ("before_update", "during", "sampling_instant = during is out of range"),
        ("response_time_s: 0.01", "response_time_s: 0.0", "response_time_s = 0.0 is out of range"),
        ("8e-6", "0.0", "stage.yaml: x: sensor_scale_m_per_v = 0 makes every displacement 0"),
        ("sensor_offset_v: 0.0", "sensor_offset_v: 12.0", "x: sensor_offset_v = 12 is not between"),
        ("sensor_low_v", "sensor_lowest_v", "x: unknown key 'sensor_lowest_v'; did you mean"),
        ("40.0", "4.0e5", "ramp_down_slew = 400000 V/s exceeds slew_limit"),
        ("{seed: 3}", "3", "stage.yaml: options should be a section"),
    ],
)
def test_wrong_settings_are_refused_with_file_key_and_fix(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    assert old in SETTINGS
    (path := tmp_path / "stage.yaml").write_text(SETTINGS.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError, match=said):
        load_settings("mylab:Stage", path)


def test_what_a_drivers_module_lacks_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lab_with_a_gap.py").write_text("import no_such_library\n", "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(InputError, match=r"; install no_such_library, which lab_with_a_gap imp"):
        driver_class("lab_with_a_gap:Stage")
    for missing in ("no_such_lab", "no_such_lab.stages"):
        with pytest.raises(InputError, match=r"No module named 'no_such_lab'; give module:Class"):
            driver_class(f"{missing}:Stage")


class Bare(Driver):
    """Takes no settings, which the interface demands."""

    def start(self, sample_period: float) -> None:
        raise NotImplementedError

    def advance(self, drive: Trace) -> Reading:
        raise NotImplementedError

    def ramp_down(self) -> float:
        raise NotImplementedError


class Optioned(Bare):
    def __init__(self, _: ScannerSettings, card: str, gain: float = 1.0) -> None:
        if gain <= 0.0:
            raise ValueError("gain must be above 0")
        self.given = card, gain


def test_options_are_the_arguments_of_the_class() -> None:
    made = open_driver(Optioned, VOLTS, {"card": "ao0", "gain": 2.0}, "stage.yaml")
    assert isinstance(made, Optioned)
    assert made.given == ("ao0", 2.0)


@pytest.mark.parametrize(
    ("kind", "options", "said"),
    [
        (Bare, {}, "driver Bare: its __init__ must take the scanner's settings"),
        (Optioned, {}, "stage.yaml: options: key 'card' is missing; add it"),
        (Optioned, {"card": 5}, "stage.yaml: options: card = 5 should be text"),
        (Optioned, {"card": "a", "gian": 1.0}, "options: unknown key 'gian'; did you mean 'gain'"),
        (Optioned, {"card": "a", "gain": -1.0}, "stage.yaml: options: gain must be above 0"),
    ],
)
def test_wrong_options_are_refused_with_file_key_and_fix(
    kind: type[Driver], options: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        open_driver(kind, VOLTS, options, "stage.yaml")
