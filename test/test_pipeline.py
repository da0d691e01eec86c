"""A scan is what the plain functions make of it, bit for bit, whatever its blocks and timing."""

from collections import deque
from collections.abc import Iterable
from functools import partial
from itertools import cycle
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest import mock

import numpy as np
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros import pipeline
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.scan_inversion import InversionSettings, OnlineCorrection, ScanInversion
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.streams import ACHIEVED, DESIRED, DRIVE
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import DriverChoice
from afm_scan_ros.drivers.guarded import Displacement, GuardedDriver
from afm_scan_ros.features.online.adaptation import TIME_CONSTANT
from afm_scan_ros.features.online.adapted_scan import adapted_scan
from afm_scan_ros.features.online.line_feedback import fed_back
from afm_scan_ros.nodes.parameters import SIMULATION, simulated_scanner
from afm_scan_ros.pipeline import ScanChain, run
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.in_process import ALL, default_model, default_plant

STREAMS = ("desired_displacement", "drive_voltage", "achieved_displacement", "true_displacement")
LIMITS = default_plant().amplifier.limits
ADAPTED = partial(adapted_scan, TIME_CONSTANT)
CHOICE = simulated_scanner({each.name: each.default for each in SIMULATION}, "simulated")


class Here:
    """A driver that answers in this process, some looks later than asked."""

    def __init__(self, late: Iterable[int], choice: DriverChoice, *_: object) -> None:
        self._late, self._looks = cycle(late), 0
        self._driver = GuardedDriver(choice.driver, choice.settings, choice.options, choice.where)
        self._answer: Displacement | None = None
        self.waiting = False

    def start(self, sample_period: float) -> None:
        self._driver.start(sample_period)

    def advance(self, drive: Trace, *, last: bool) -> None:
        self._answer = self._driver.advance(drive, last=last)
        self.waiting, self._looks = True, next(self._late)

    def answer(self, _: float) -> Displacement | None:
        self._looks -= 1
        if self._looks >= 0:
            return None
        self.waiting = False
        return self._answer

    def show_life(self) -> None: ...

    def ramp_down(self, why: str) -> str:
        return why

    def close(self) -> str:
        return ""


class Unheard:
    def doing(self, _: str) -> None: ...
    def moved(self, _: int, __: int) -> None: ...
    def say(self, _: str) -> None: ...


def through(corrections: list[OnlineCorrection], references: Iterable[Trace]) -> list[Trace]:
    for each in corrections:
        references = list(each.corrected(references))
    return list(references)


def plainly(spec: ScanSpec, size: int, given: InversionSettings) -> dict[str, list[Trace]]:
    """Return the blocks of each stream, one after the other, by the functions of core alone."""
    model, plant, period = default_model(), default_plant(), spec.sample_period
    compensation = Compensation(model, period, given.inverses, given.inverse, given.limits)
    corrections = [
        make(model, spec, compensation.held_back, given.latency) for make in given.corrections
    ]
    scanner, progress = Piezoscanner(plant, period, 1), compensation.at_rest()
    done: dict[str, list[Trace]] = {name: [] for name in STREAMS}
    total = total_samples(spec)

    def observed(name: str, block: Trace) -> list[Trace]:
        found = []
        for place, each in enumerate(corrections, 1):
            each.observe(name, block)
            found += through(corrections[place:], each.corrected())
        return found

    def drive_of(block: Trace) -> Trace:
        nonlocal progress
        progress, drive = compensation.invert(progress, block)
        if block.first_sample + len(block.x) < total:
            return drive
        owed = compensation.finish(progress)
        x, y = np.append(drive.x, owed.x), np.append(drive.y, owed.y)
        return Trace(drive.first_sample, period, x, y)

    for first in range(0, total, size):
        block = desired(spec, first, min(size, total - first))
        done[STREAMS[0]].append(block)
        waiting = deque([*observed(DESIRED, block), *through(corrections, [block])])
        while waiting:
            drive = drive_of(waiting.popleft())
            observed(DRIVE, drive)
            if not len(drive.x):
                continue
            measured, true = scanner.advance(drive)
            for name, trace in zip(STREAMS[1:], (drive, measured, true), strict=True):
                done[name].append(trace)
            waiting.extend(observed(ACHIEVED, measured))
    return done


def chain(spec: ScanSpec, size: int, given: InversionSettings, window: int = 0) -> ScanChain:
    return ScanChain(
        evolve(info_of_scan(spec, "one", 10**18), window=window or 20 * size),
        partial(desired, spec),
        size,
        CHOICE,
        "piezoscanner_sim",
        STREAMS,
        0.0,
        ScanInversion(default_model(), spec, given),
        100,
    )


specs = st.builds(
    ScanSpec,
    pattern=st.sampled_from(["raster", "sinusoidal"]),
    range_x=st.just(10e-6),
    range_y=st.just(10e-6),
    line_rate=st.floats(60.0, 150.0),
    lines=st.integers(2, 16),
    samples_per_line=st.integers(100, 200).map(lambda half: 2 * half),
    turnaround=st.floats(0.1, 0.3),
    preparation=st.just("none"),
    approach=st.just(0.02),
    settle=st.just(0.02),
)
every = st.builds(
    InversionSettings,
    st.sets(st.sampled_from(ALL)).map(frozenset),
    st.just(LIMITS),
    corrections=st.sampled_from([(), (fed_back,), (ADAPTED,), (fed_back, ADAPTED)]),
)


@given(
    specs,
    st.integers(20, 4000),
    st.integers(0, 10_000),
    every,
    st.lists(st.integers(0, 3), min_size=1),
)
@settings(max_examples=30)
def test_a_scan_is_what_the_functions_make_of_it(
    spec: ScanSpec, size: int, window: int, given: InversionSettings, late: list[int]
) -> None:
    expected = plainly(spec, size, given)
    with (
        TemporaryDirectory() as folder,
        mock.patch.object(pipeline, "DriverProcess", partial(Here, late)),
    ):
        run(chain(spec, size, given, window), Path(folder) / "bag", Unheard())
        recorded = read_scan(Path(folder) / "bag")
        assert recorded.warnings == ()
        for name, blocks in expected.items():
            found = recorded.whole(name)
            for axis in ("x", "y"):
                whole = np.concatenate([block.axis(axis) for block in blocks])
                np.testing.assert_array_equal(found.axis(axis), whole)
