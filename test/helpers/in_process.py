"""Scans and experiments in the test's own process: the nodes' core without nodes."""

from collections.abc import Iterable
from functools import cache

from attrs import define, field

from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.records.recording import checked
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, phases, total_samples
from afm_scan_ros.core.types import Array, Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

SEED = 1
ALL = ("creep", "hysteresis", "vibration")
SPEC = ScanSpec(lines=6)
FAST_SPEC = ScanSpec(lines=6, line_rate=100.0, samples_per_line=500, turnaround=0.2)


@cache
def default_model() -> ScannerModel:
    """Return the model in ``config/model.yaml``."""
    return load_model(share_directory() / "config/model.yaml")


@cache
def default_plant() -> PlantSpec:
    """Return the plant in ``config/plant.yaml``."""
    return load_plant(share_directory() / "config/plant.yaml")


def scan(
    spec: ScanSpec,
    inverses: Iterable[str],
    settings: InverseSettings | None = None,
    plant: PlantSpec | None = None,
    model: ScannerModel | None = None,
    seed: int = SEED,
    correction: Correction | None = None,
) -> Scan:
    """Scan the plant with the model's inverses; each is the default one where none is given."""
    scanned = plant or default_plant()
    compensation = Compensation(
        model or default_model(),
        spec.sample_period,
        inverses,
        settings or InverseSettings(),
        scanned.amplifier.limits,
    )
    target = desired(spec, 0, total_samples(spec))
    commanded = compensation.whole(target if correction is None else correction.reference())
    measured, true = Piezoscanner(scanned, spec.sample_period, seed).advance(commanded)
    return Scan(spec, target, commanded, measured, true)


def lines_of(spec: ScanSpec, signal: Array) -> Array:
    """Return the part of a whole scan's signal that lies on its lines."""
    where = phases(spec).lines
    return signal[where.start : where.stop]


@define
class InProcessSession:
    """A scanner that begins each scan at rest; the sensor's noise differs from scan to scan."""

    plant: PlantSpec
    seed: int = SEED
    _made: int = field(default=0, init=False)

    def scan(
        self,
        label: str,  # noqa: ARG002 - the interface's
        spec: ScanSpec,
        model: ScannerModel,
        correction: Correction | None = None,
    ) -> Scan:
        """Scan with all of a model's inverses. Raises ScanError where that cannot be."""
        seed = self._next_seed()
        return scan(spec, ALL, InverseSettings(), self.plant, model, seed, correction)

    def experiment(self, plan: Plan) -> Record:
        """Drive the scanner through an experiment, which the plan is named after."""
        drive, measured = drive_through(plan, self.plant, self._next_seed())
        return Record.of_traces(plan.name, drive, measured, kind=plan.name)

    def _next_seed(self) -> int:
        self._made += 1
        return self.seed + self._made - 1


def record(plan: Plan, plant: PlantSpec, seed: int) -> Record:
    """Drive a scanner fresh from rest through one plan.

    Raises InputError where that is no calibration record, as an axis at rest is none.
    """
    return checked(Record.of_traces(plan.name, *drive_through(plan, plant, seed)))


def drive_through(plan: Plan, plant: PlantSpec, seed: int) -> tuple[Trace, Trace]:
    """Drive (V) and measured displacement (m) of a scanner fresh from rest."""
    scanner = Piezoscanner(plant, plan.sample_period, seed)
    drive = excitation_block(plan, 0, plan.total_samples)
    measured, _ = scanner.advance(drive)
    return drive, measured
