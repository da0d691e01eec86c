"""Every damage to every kind of record gets a message that names it; good records get none."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from attrs import evolve
from small_plans import PLANS

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import excitation_block
from afm_scan_ros.core.identification.records.recording import problems
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec
from helpers.in_process import default_plant

Signals = tuple[Trace, Trace]
PLACE, COUNT = 0.37, 113
"""Where in a record samples are spoilt, and how many."""
LATE = 0.13
"""s"""


def record(kind: str, plant: PlantSpec) -> Signals:
    plan = PLANS[kind]
    drive = excitation_block(plan, 0, plan.total_samples)
    return drive, Piezoscanner(plant, plan.sample_period, 1).advance(drive)[0]


@pytest.fixture(scope="module")
def good() -> dict[str, Signals]:
    return {kind: record(kind, default_plant()) for kind in PLANS}


def measured(change: Callable[[Array], Array]) -> Callable[[Trace, Trace], Signals]:
    """Spoil what was measured of x."""
    return lambda drive, moved: (drive, evolve(moved, x=change(moved.x)))


def held(values: Array) -> Array:
    first = int(PLACE * len(values))
    held = values.copy()
    held[first : first + COUNT] = values[first]
    return held


def lost(values: Array) -> Array:
    first = int(PLACE * len(values))
    return np.concatenate([values[:first], values[first + COUNT :], values[-COUNT:]])


def repeated(values: Array) -> Array:
    first = int(PLACE * len(values))
    twice = values.copy()
    twice[first : first + COUNT] = values[first - COUNT : first]
    return twice


def spike(values: Array) -> Array:
    spoilt = values.copy()
    spoilt[int(PLACE * len(values))] += 3e-7
    return spoilt


def nan(values: Array) -> Array:
    spoilt = values.copy()
    spoilt[7] = np.nan
    return spoilt


def rows_lost(drive: Trace, moved: Trace) -> Signals:
    """Rows of the table are missing: drive and displacement alike."""
    first = int(PLACE * len(drive.x))
    gone = np.arange(first, first + COUNT)
    return tuple(evolve(t, x=np.delete(t.x, gone), y=np.delete(t.y, gone)) for t in (drive, moved))


def late(seconds: float) -> Callable[[Trace, Trace], Signals]:
    def shift(drive: Trace, moved: Trace) -> Signals:
        return drive, evolve(moved, x=np.roll(moved.x, round(seconds / drive.sample_period)))

    return shift


def swapped(drive: Trace, moved: Trace) -> Signals:
    return drive, evolve(moved, x=moved.y, y=moved.x)


def of_y(drive: Trace, moved: Trace) -> Signals:
    """Both measured channels show y."""
    return drive, evolve(moved, x=moved.y)


def first_rows(drive: Trace, moved: Trace) -> Signals:
    return tuple(evolve(t, x=t.x[:3], y=t.y[:3]) for t in (drive, moved))


def in_millivolts(drive: Trace, moved: Trace) -> Signals:
    return evolve(drive, x=1e3 * drive.x), moved


Damage = tuple[Callable[[Trace, Trace], Signals], str, tuple[str, ...]]
DAMAGE: dict[str, Damage] = {
    "clipped": (measured(lambda x: np.minimum(x, 0.7 * x.max())), "clipped at its upper end", ()),
    "held": (measured(held), "(stands still|jumps, as if samples were lost, held)", ()),
    "lost": (measured(lost), "(jumps, as if samples were lost|are not synchronised)", ()),
    "repeated": (measured(repeated), "repeats what was before", ("creep",)),
    "rows lost": (rows_lost, "jumps, as if samples were lost", ("creep", "validation")),
    "spike": (measured(spike), "(has a spike|held or disturbed)", ()),
    "NaN": (measured(nan), "displacement is nan at sample 7, channel 0", ()),
    "constant": (measured(np.zeros_like), "displacement x never changes", ()),
    "late": (late(LATE), "displacement x lags its drive", ()),
    "early": (late(-LATE), "displacement x leads its drive", ()),
    "µm": (measured(lambda x: 1e6 * x), "is it in µm", ()),
    "mV": (in_millivolts, "is it in mV", ("creep",)),
    "sign": (measured(np.negative), "the other sign", ()),
    "swapped": (swapped, "displacement x follows drive y: it is a record of axis y", ()),
    "y alone": (of_y, "displacement x follows drive y: it is a record of axis y", ()),
    "three rows": (first_rows, "it holds 3 samples", ()),
}
"""The damage, the word in its message, and the records in which it is not detectable."""
CASES = [
    (kind, name)
    for name, (_, _, undetectable) in DAMAGE.items()
    for kind in PLANS
    if kind not in undetectable
]


@pytest.mark.parametrize(("kind", "name"), CASES)
def test_damage_is_named(good: dict[str, Signals], kind: str, name: str) -> None:
    spoil, word, _ = DAMAGE[name]
    drive, displacement = spoil(*good[kind])
    try:
        worst = next(problems(Record.of_traces("record", drive, displacement)), "")
    except InputError as error:
        worst = str(error)
    assert re.search(word, worst), worst


SENSORS = {
    "without noise": {"noise_rms": 0.0},
    "as it is": {},
    "ten times the noise": {"noise_rms": 20e-9},
    "12 bits": {"bits": 12},
    "12 bits without noise": {"bits": 12, "noise_rms": 0.0},
}


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("kind", PLANS)
def test_a_good_record_gets_no_message(kind: str, sensor: str) -> None:
    plant = default_plant()
    plant = evolve(plant, sensor=evolve(plant.sensor, **SENSORS[sensor]))
    assert list(problems(Record.of_traces(kind, *record(kind, plant)))) == []
