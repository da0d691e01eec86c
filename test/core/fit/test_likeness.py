"""A record of another scanner, or with its columns exchanged, is refused among those of one."""

import numpy as np
import pytest
from attrs import evolve

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.fit.axis import started
from afm_scan_ros.core.fit.likeness import _RecordGain, _refuse_backward, refuse_unlike
from afm_scan_ros.core.fit.settings import DEFAULT_SETTINGS
from afm_scan_ros.core.record import Record

PERIOD = 1e-3


def records(gain: float) -> list[Record]:
    """Triangles of three sizes of plays with noise; ``gain`` in m/V."""
    found = []
    for seed, size in enumerate((20.0, 50.0, 95.0)):
        drive = size * (1.0 - np.abs(1.0 - 2.0 * (5.0 * PERIOD * np.arange(1000) % 1.0)))
        plays, moved = np.zeros(10), []
        for each in drive:
            plays = np.clip(plays, *(each + side * np.linspace(0.0, 45.0, 10) for side in (-1, 1)))
            moved.append(gain * (0.75 * each + 0.25 * plays.mean()))
        noise = np.random.default_rng(seed).normal(0.0, 1e-4 * gain * size, len(drive))
        found.append(Record(drive, np.roll(moved, 1) + noise, PERIOD, name=f"{size:.0f} V"))
    return found


def exchanged(one: Record) -> Record:
    """Record whose two columns, in V and µm, are exchanged."""
    return evolve(one, drive=1e6 * one.displacement, displacement=1e-6 * one.drive)


def check(given: list[Record]) -> None:
    refuse_unlike(started(given, "x", DEFAULT_SETTINGS))


@pytest.mark.parametrize("gain", [0.2e-6, 1e-6, 10e-6])
@pytest.mark.parametrize("which", range(3))
def test_a_record_whose_columns_are_exchanged_is_named(gain: float, which: int) -> None:
    given = records(gain)
    check(given)
    given[which] = exchanged(given[which])
    with pytest.raises(InputError, match=rf"^{given[which].name}: .*columns are exchanged"):
        check(given)


def test_of_two_records_the_loops_show_which_is_exchanged() -> None:
    first, second, _ = records(0.5e-6)
    with pytest.raises(InputError, match=r"^50 V: .* but 20 V .* exchanged"):
        check([first, exchanged(second)])


def test_a_record_of_another_unit_is_named() -> None:
    given = records(0.3e-6)
    given[1] = evolve(given[1], displacement=1e3 * given[1].displacement)
    with pytest.raises(InputError, match=r"^50 V: it moves .* unit"):
        check(given)


def test_the_gain_of_one_scanner_may_grow_with_its_swing_and_not_fall() -> None:
    """Loops of a small swing follow a smaller part of the plays."""
    given = records(0.3e-6)
    shrunk = evolve(given[0], displacement=given[0].displacement / 3.0)
    check([shrunk, *given[1:]])
    with pytest.raises(InputError, match=r"^95 V: it moves"):
        check([*given[:2], evolve(given[2], displacement=given[2].displacement / 3.0)])


@pytest.mark.parametrize(("loops", "refused"), [(-189.0, False), (-300.0, True), (-124.0, False)])
def test_loops_that_may_be_those_of_noise_are_not_backward(loops: float, *, refused: bool) -> None:
    """A multisine of 0.8 V that begins at once, beside moves of 10 V that lag by 246 at least."""
    moves = _RecordGain("moves", 1.17, 20.0, 1132.0, 886.0)
    waves = _RecordGain("waves", 0.954, 1.6, loops, 165.0)
    if not refused:
        _refuse_backward([waves, moves], 8.06e-7, DEFAULT_SETTINGS.like_gains)
        return
    with pytest.raises(InputError, match=r"^waves: .* are exchanged"):
        _refuse_backward([waves, moves], 8.06e-7, DEFAULT_SETTINGS.like_gains)
