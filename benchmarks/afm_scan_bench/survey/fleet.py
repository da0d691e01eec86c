"""Instruments drawn at random, which are scanned every night, and three of which change."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from afm_scan_bench.diagnosis.unmodelled.scanner import healthy_scanner
from afm_scan_bench.mechanisms.product_sizes import sized
from afm_scan_bench.scans import spec_at
from afm_scan_bench.session import InProcessSession
from afm_scan_ros.bag.writer import ScanWriter
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_info import info_of_scan
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import model_hash, save_model
from afm_scan_ros.simulation.axis import AxisSpec, detuned_axis, series, with_series
from afm_scan_ros.simulation.scanner import PlantSpec

GAIN, RESONANCE, CREEP = 1e-4, 3e-4, 3e-3
"""Standard deviations from night to night, relative."""
KINDS = ("parameter_shift_gain", "parameter_shift_resonance", "backlash", "delay")
"""Changes that are drawn, all small ones (mechanisms/product_sizes.py)."""
EARLIEST = 0.2
"""Share of the nights that are before any change, and after it, at least."""
START, NIGHT = 1_767_225_600 * 10**9, 86_400 * 10**9
"""First night, and time to the next, ns."""
SCANS = (
    evolve(spec_at(30.0), lines=60),
    evolve(spec_at(100.0), lines=100, range_x=20e-6, range_y=20e-6),
)
"""Two users' scans, of 3 to 4 s; which of them a night has is drawn."""


@frozen(eq=False)
class Instrument:
    """A drawn scanner with its model; from ``night`` on it has a change on an axis, if any."""

    name: str
    seed: int
    plant: PlantSpec
    model: ScannerModel
    kind: str = ""
    axis: str = ""
    night: int = 0

    def at_night(self, night: int) -> PlantSpec:
        """Return the scanner of a night: its parameters scatter about their own."""
        rng = np.random.default_rng((self.seed, night))
        x, y = (_scattered(axis, rng) for axis in (self.plant.x, self.plant.y))
        changed = self.kind and night >= self.night
        added = sized(self.kind, "small", self.axis) if changed else ()
        return evolve(self.plant, x=x, y=y, mechanisms=(*self.plant.mechanisms, *added))

    def record(self, folder: Path, night: int) -> None:
        """Record the scan of a night in a bag."""
        rng = np.random.default_rng((self.seed, night, 1))
        spec = SCANS[int(rng.integers(len(SCANS)))]
        session = InProcessSession(self.at_night(night), seed=int(rng.integers(2**31)))
        done = session.scan(self.name, spec, self.model)
        info = info_of_scan(spec, f"{self.name} {night}", START + night * NIGHT)
        info = evolve(info, model_hash=model_hash(self.model))
        with ScanWriter(folder / self.name / f"night_{night:03}", info) as bag:
            bag.add("drive_voltage", done.drive)
            bag.add("achieved_displacement", done.measured)


def drawn_fleet(count: int, changing: int, nights: int, seed: int) -> Iterator[Instrument]:
    """Yield instruments; which of them change, how and when is drawn too."""
    rng = np.random.default_rng((2026, seed))
    chosen = set(rng.permutation(count)[:changing].tolist())
    for number in range(count):
        own = 1000 * seed + number
        made = Instrument(f"afm_{number}", own, *healthy_scanner(own, 1.0))
        kind, axis = (str(rng.choice(some)) for some in (KINDS, AXES))
        first, last = EARLIEST * nights, (1.0 - EARLIEST) * nights
        night = int(rng.integers(int(first), int(last) + 1))
        yield evolve(made, kind=kind, axis=axis, night=night) if number in chosen else made


def write_fleet(fleet: Iterator[Instrument], nights: int, folder: Path) -> list[Instrument]:
    """Write each instrument's model, and its bags of some nights; return the instruments."""
    done = []
    (folder / "models").mkdir(parents=True)
    for each in fleet:
        save_model(folder / f"models/{each.name}.yaml", each.model, f"Model of {each.name}.")
        for night in range(nights):
            each.record(folder / "bags", night)
        done.append(each)
    return done


def _scattered(axis: AxisSpec, rng: np.random.Generator) -> AxisSpec:
    gain, resonance, creep = (1.0 + s * rng.standard_normal() for s in (GAIN, RESONANCE, CREEP))
    moved = detuned_axis(axis, resonance, 1.0)
    hysteresis = evolve(moved.hysteresis, gain=gain * moved.hysteresis.gain)
    gains, taus = series(moved.creep)
    return evolve(moved, hysteresis=hysteresis, creep=with_series(moved.creep, creep * gains, taus))
