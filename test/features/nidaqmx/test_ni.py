"""NI's own client against a server that speaks NI's protocol, with the simulated scanner."""

import re
import sys
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import create_autospec

import numpy as np
import pytest

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import driver_class, load_settings
from afm_scan_ros.drivers.client import DriverProcess
from afm_scan_ros.drivers.guarded import Displacement, GuardedDriver
from afm_scan_ros.drivers.link import DriverTimeouts
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import default_plant
from helpers.ni_twin import BUFFER, ROOT, outputs, settings_file, twin

watchdog = pytest.importorskip("nidaqmx.system.watchdog")  # a ROS machine need not have the extra
pytest.importorskip("grpc")

PERIOD, COUNT, BLOCK = 1e-4, 4000, 500
EARLY = round(BUFFER / PERIOD)
TIME = PERIOD * np.arange(COUNT)
WAVE = Trace(0, PERIOD, 2.0 * np.sin(3.0 * TIME), -np.sin(3.0 * TIME))
FAULT_AT = EARLY + 2200
STEEPEST = 40.0 * PERIOD
"""V, between two samples of a ramp."""


def opened(folder: Path, server: str, **options: object) -> GuardedDriver:
    choice = load_settings("nidaqmx", settings_file(folder, server))
    return GuardedDriver("nidaqmx", choice.settings, choice.options | options, choice.where)


def blocks() -> Iterator[Trace]:
    for first in range(0, COUNT, BLOCK):
        part = slice(first, first + BLOCK)
        yield Trace(first, PERIOD, WAVE.x[part], WAVE.y[part])


def test_the_samples_are_those_of_the_scanner_alone_and_the_outputs_come_to_rest(
    tmp_path: Path,
) -> None:
    with twin(tmp_path) as server:
        driver = opened(tmp_path, server)
        driver.start(PERIOD)
        assert driver.latency_samples == EARLY
        read = [driver.advance(b, last=b.first_sample == COUNT - BLOCK).measured for b in blocks()]
        assert driver.ramp_down() > 0.0
        out = outputs(tmp_path)
        driver.start(PERIOD)  # the tasks of the scan before are released
        driver.ramp_down()
    alone, _ = Piezoscanner(default_plant(), PERIOD, seed=1).advance(WAVE)
    np.testing.assert_array_equal(np.concatenate([r.x for r in read]), alone.x)
    np.testing.assert_array_equal(np.concatenate([r.y for r in read]), alone.y)
    whole = np.stack([WAVE.x, WAVE.y], axis=1)
    ramp = ramp_to_rest(0, PERIOD, {"x": whole[-1, 0], "y": whole[-1, 1]}, 40.0)
    held = np.repeat(whole[-1:], EARLY, axis=0)
    expected = np.concatenate([np.zeros_like(held), whole, held, np.stack([ramp.x, ramp.y], 1)])
    np.testing.assert_array_equal(out[: len(expected)], expected)
    assert not np.any(out[len(expected) :])


def test_the_documented_driver_refreshes_its_watchdog_and_ends_it_after_the_ramp(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """NI's watchdog is a substitute: no protocol of a server has been written for it."""
    page = (ROOT / "docs/how_to/hardware.md").read_text("utf-8")
    (block,) = re.findall(r"^```py\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "watched.py").write_text(block, "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    task = create_autospec(watchdog.WatchdogTask, instance=True)
    made = create_autospec(watchdog.WatchdogTask, return_value=task)
    monkeypatch.setattr(watchdog, "WatchdogTask", made)
    with twin(tmp_path) as server:
        choice = load_settings("nidaqmx", settings_file(tmp_path, server))
        options = {**choice.options, "watchdog_s": 5.0}
        driver = GuardedDriver("watched:Watched", choice.settings, options, choice.where)
        driver.start(PERIOD)
        first, second, *_ = blocks()
        driver.advance(first, last=False)
        driver.advance(second, last=True)
        assert not task.close.called
        driver.ramp_down()
        np.testing.assert_array_equal(outputs(tmp_path)[-1], [0.0, 0.0])
    assert made.call_args.kwargs == {"timeout": 5.0}
    steps = [call[0] for call in task.method_calls]
    assert steps == ["cfg_watchdog_ao_expir_states", "start", *["reset_timer"] * 3, "close"]
    (rest,) = task.cfg_watchdog_ao_expir_states.call_args.args
    assert [(each.physical_channel, each.expiration_state) for each in rest] == [
        ("Dev1/ao0", 0.0),
        ("Dev1/ao1", 0.0),
    ]


FAULTS = {
    "underrun": r"underrun: a sample was not output in time \(NI-DAQmx -200290\)",
    "underflow": r"underrun: a sample was not output in time \(NI-DAQmx -200621\)",
    "overrun": r"overrun: a sample was not read in time \(NI-DAQmx -200279\)",
}


def test_a_fault_is_named_and_the_ramp_begins_where_the_outputs_stand(tmp_path: Path) -> None:
    with twin(
        tmp_path, *(word for f in FAULTS for word in ("--fault", f, str(FAULT_AT)))
    ) as server:
        before = 0
        for fault, said in FAULTS.items():
            driver = opened(tmp_path, server)
            driver.start(PERIOD)
            with pytest.raises(ScanError, match=said):
                deque(driver.advance(block, last=False) for block in blocks())
            driver.ramp_down()
            out = outputs(tmp_path)[before:]
            before += len(out)
            assert np.max(np.abs(out)) > 1.0, fault
            assert not np.any(out[-1]), fault
            drift = BLOCK * np.max(np.abs(np.diff(WAVE.x)))  # of an output in a chunk
            allowed = STEEPEST + (drift if fault == "underflow" else 0.0)
            assert np.max(np.abs(np.diff(out, axis=0))) <= allowed * (1.0 + 1e-6), fault


def test_a_server_that_does_not_answer_is_named_and_the_drive_ramps_down_meanwhile(
    tmp_path: Path,
) -> None:
    with twin(tmp_path, "--fault", "hang", str(FAULT_AT)) as server:
        choice = load_settings("nidaqmx", settings_file(tmp_path, server))
        waits = DriverTimeouts(60.0, 60.0, 60.0, answer=0.5, real_time=False)
        driver = DriverProcess(choice, waits).opened()
        driver.start(PERIOD)
        assert driver.answer(60.0) is None
        with pytest.raises(ScanError) as raised:
            deque(answered(driver, block) for block in blocks())
        said = driver.ramp_down(str(raised.value))
        driver.close()
        assert re.fullmatch(r"the driver has not answered for \S+ s; drive ramped down .*", said)
        np.testing.assert_array_equal(outputs(tmp_path)[-1], [0.0, 0.0])


def answered(driver: DriverProcess, block: Trace) -> Displacement:
    driver.advance(block, last=False)
    while (answer := driver.answer(0.01)) is None:
        pass
    return answer


def test_what_the_converter_cannot_do_is_refused_at_the_start(tmp_path: Path) -> None:
    with twin(tmp_path) as server:
        odd = opened(tmp_path, server)
        with pytest.raises(InputError, match=r"samples at 33333333\.3 Hz, not at 30000000 Hz"):
            odd.start(1.0 / 3e7)
        path = settings_file(tmp_path, server)
        path.write_text(path.read_text("utf-8").replace("Dev1/ai1", "Dev2/ai1"), "utf-8")
        choice = load_settings("nidaqmx", path)
        other = GuardedDriver("nidaqmx", choice.settings, choice.options, choice.where)
        with pytest.raises(InputError, match=r"^NI-DAQmx: .* Status Code: -200220$"):
            other.start(PERIOD)
    with pytest.raises(InputError, match=r"NI-DAQmx: .*UNAVAILABLE: Failed to connect to server"):
        opened(tmp_path, server).start(PERIOD)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"terminals": "DIFFERENTIAL"}, "options: terminals = DIFFERENTIAL is unknown: give one"),
        ({"buffer_s": 0.0}, "options: buffer_s = 0 should be above 0"),
    ],
)
def test_wrong_options_of_a_converter_are_refused(
    tmp_path: Path, options: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match=rf"stage\.yaml: {said}"):
        opened(tmp_path, "127.0.0.1:1", **options)


def test_a_missing_library_is_refused_with_the_fix(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [n for n in sys.modules if n.startswith("afm_scan_ros.features.nidaqmx.driver")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "nidaqmx", None)
    said = r"^driver nidaqmx: .*; pip install 'afm_scan_ros\[nidaqmx\]'$"
    with pytest.raises(InputError, match=said):
        driver_class("nidaqmx")
