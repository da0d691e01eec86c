"""Scanners of five families of hysteresis, each between memoryless maps, with the default stage."""

from collections.abc import Mapping

import numpy as np
from attrs import frozen

from afm_scan_bench.families.operators import (
    LIMIT,
    BoucWen,
    Duhem,
    LorentzianPreisach,
    Mapped,
    Operator,
    Plays,
    SlipElements,
    applied,
)
from afm_scan_bench.scans import ALL, SEED, default_plant
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.identification.drives.excitation import PLANS, excitation_block
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import AxisModel, InverseSettings, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.simulation.axis import Dynamics
from afm_scan_ros.simulation.scanner import read

RANGE = 11.0
"""V of effective input over the drive's range, as the paper's scanner has."""


def _plays() -> Plays:
    edges = LIMIT * (np.arange(61) / 60) ** 2
    thresholds = 0.5 * (edges[1:] + edges[:-1])
    return Plays(thresholds, 1.3 * np.exp(-thresholds) * np.diff(edges))


FAMILIES: Mapping[str, Operator] = {
    "play": _plays(),
    "slip": SlipElements(np.linspace(0.0024, 0.06, 14), np.full(14, 0.065)),
    "preisach": LorentzianPreisach(share=2.6, coercive=0.5, width=1.2),
    "bouc_wen": BoucWen(alpha=0.42, beta=0.6, gamma=0.2),
    "duhem": Duhem(rate=0.6, slope=1.0, inner=0.7),
}
"""Loops 12 to 14 % wide over ±4 V."""

Powers = tuple[float, float]
NONE, SQUARE, CUBE = (0.0, 0.0), (-0.012, 0.0), (0.0, -0.003)
"""Coefficients of the square (1/V) and of the cube (1/V^2): some 5 % at 4 V."""
MAPS: Mapping[str, tuple[Powers, Powers]] = {
    "none": (NONE, NONE),
    "square before": (SQUARE, NONE),
    "cube before": (CUBE, NONE),
    "square behind": (NONE, SQUARE),
    "cube behind": (NONE, CUBE),
    "square before, cube behind": (SQUARE, CUBE),
    "cube before, square behind": (CUBE, SQUARE),
}
"""Maps before and behind the operator."""


@frozen(eq=False)
class FamilyScanner:
    """One axis: an operator, scaled by ``gain`` (1), before the default plant's stage and creep."""

    operator: Operator
    gain: float

    @classmethod
    def of(cls, family: str, maps: str) -> "FamilyScanner":
        """Take a family between maps, over RANGE from -LIMIT to LIMIT once it has been at both."""
        operator = Mapped(FAMILIES[family], *MAPS[maps])
        swing = np.linspace(-1.0, 1.0, 2001)
        ends = applied(operator, LIMIT * np.concatenate((swing[1000:], -swing, swing)))[[-2001, -1]]
        return cls(operator, RANGE / float(np.ptp(ends)))

    def displacement(self, drive: Array, sample_period: float, seed: int) -> tuple[Array, Array]:
        """Measured and true displacement (m) for a whole drive (V) from rest, all (n,)."""
        plant = default_plant()
        stage = Dynamics.from_spec(plant.x, plant.sensor_sensitivity)
        effective = self.gain * applied(self.operator, drive)
        true = stage.apply(stage.at_rest(), effective, sample_period)[1]
        trace = Trace(0, sample_period, true, true)
        return read(plant.sensor, trace, np.random.default_rng(seed)).x, true

    def reach(self) -> float:
        """Twice the way (m) from rest to the nearer end of the drive's range."""
        rise = np.linspace(0.0, LIMIT, 1001)
        ends = [self.gain * float(applied(self.operator, way * rise)[-1]) for way in (1.0, -1.0)]
        stage = Dynamics.from_spec(default_plant().x, default_plant().sensor_sensitivity)
        return 2.0 * min(abs(end) for end in ends) * float(stage.response(np.array([1e3]))[0].real)

    def records(self, seed: int = SEED) -> dict[str, Record]:
        """Return the calibration records, each of a scanner fresh from rest, by name."""
        found = {}
        for name, plan in PLANS.items():
            made = plan()
            drive = excitation_block(made, 0, made.total_samples).x
            measured, _ = self.displacement(drive, made.sample_period, seed)
            found[name] = Record(
                drive, measured, made.sample_period, kind=name, start="depolarised", name=name
            )
        return found

    def scan(self, spec: ScanSpec, model: AxisModel) -> Scan:
        """Scan with all inverses of a model; both axes are alike."""
        both, period = ScannerModel(model, model), spec.sample_period
        limits = default_plant().amplifier.limits
        compensation = Compensation(both, period, ALL, InverseSettings(), limits)
        target = desired(spec, 0, total_samples(spec))
        drive = compensation.whole(target)
        moved = [self.displacement(drive.axis(name), period, SEED) for name in "xy"]
        measured, true = (Trace(0, period, *pair) for pair in zip(*moved, strict=True))
        return Scan(spec, target, drive, measured, true)
