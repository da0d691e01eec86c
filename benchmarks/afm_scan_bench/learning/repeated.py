"""Learning in one process: the product's loop on the simulated scanner, without nodes."""

from attrs import define, field

from afm_scan_bench.scans import ALL, SEED, default_model
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.features.learning.loop import LearningScan, learn
from afm_scan_ros.simulation.scanner import Piezoscanner, PlantSpec

SCANS = 6


@define
class RepeatingScanner:
    """A simulated scanner that begins each scan at rest, with other noise in each scan."""

    plant: PlantSpec
    seed: int = SEED
    _made: int = field(default=0, init=False)

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction) -> Scan:  # noqa: ARG002 - for those who keep files
        """Scan with a corrected reference and all of a model's inverses."""
        return self.driven(spec, self.drive(spec, model, correction))

    def drive(self, spec: ScanSpec, model: ScannerModel, correction: Correction) -> Trace:
        """Return the drive of a scan, V. Raises ScanError where it would leave the limits."""
        limits = self.plant.amplifier.limits
        compensation = Compensation(model, spec.sample_period, ALL, InverseSettings(), limits)
        return compensation.whole(correction.reference())

    def driven(self, spec: ScanSpec, drive: Trace) -> Scan:
        """Scan with a given drive, V."""
        self._made += 1
        scanner = Piezoscanner(self.plant, spec.sample_period, self.seed + self._made - 1)
        measured, true = scanner.advance(drive)
        return Scan(spec, desired(spec, 0, total_samples(spec)), drive, measured, true)


def repeated(
    spec: ScanSpec,
    plant: PlantSpec,
    scans: int = SCANS,
    model: ScannerModel | None = None,
    seed: int = SEED,
) -> list[LearningScan]:
    """Learn a scan of a plant with a model, the default one where None."""
    scanner = RepeatingScanner(plant, seed)
    known = model or default_model()
    return list(learn(scanner, known, spec, scans, plant.amplifier.limits))
