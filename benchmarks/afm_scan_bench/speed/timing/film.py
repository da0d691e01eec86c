"""How fast hysteresis is whose plays are dragged through a film, beside the same without a film."""

from collections.abc import Iterator

from afm_scan_bench.scans import default_model
from afm_scan_bench.speed.timing.chain import long_scan
from afm_scan_bench.speed.timing.preisach import drives
from afm_scan_bench.speed.timing.race import Task, race
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.viscous_plays import ViscousPlays
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row

LAG = 1e-3
ACTIVATION = 1e-2  # V


def rows(samples: int, turns: int) -> Iterator[Row]:
    """Race each kind of film over the drive of a scan, forwards and backwards."""
    surface, period = default_model().axis("x").hysteresis.surface, long_scan().sample_period
    drive, plain = drives(samples)["scan"], Preisach(surface)
    without = Task(lambda: plain.apply(plain.at_rest(), drive), samples)
    films = {
        "a film": ViscousPlays(surface, LAG, period),
        "a film that heat helps": ViscousPlays(surface, LAG, period, ACTIVATION),
    }
    for name, film in films.items():
        there, back = _ways(film, drive)
        yield race(f"hysteresis with {name}", there, "without", without, "", turns)
        yield race(f"exact inverse of that with {name}", back, "the same", without, "", turns)


def _ways(film: ViscousPlays, drive: Array) -> tuple[Task, Task]:
    """Forward, and back from what that gives."""
    rest, effective = film.at_rest(), film.apply(film.at_rest(), drive)[1]
    there = Task(lambda: film.apply(rest, drive), len(drive))
    return there, Task(lambda: film.invert(rest, effective), len(drive))
