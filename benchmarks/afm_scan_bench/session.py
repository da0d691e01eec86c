"""A laboratory within one process: the simulated scanner, without nodes and without bags."""

from attrs import define, field

from afm_scan_bench.in_process import drive_through
from afm_scan_bench.scans import ALL, SEED, scan
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.simulation.scanner import PlantSpec


@define
class InProcessSession:
    """A scanner that begins each scan at rest, and whose sensor's noise is another each time."""

    plant: PlantSpec
    seed: int = SEED
    _made: int = field(default=0, init=False)

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel) -> Scan:  # noqa: ARG002 - for those who keep files
        """Scan with all of a model's inverses. Raises ScanError where that cannot be."""
        return scan(spec, ALL, InverseSettings(), self.plant, model, seed=self._next_seed())

    def experiment(self, plan: Plan) -> Record:
        """Drive the scanner through an experiment, which the plan is named after."""
        drive, measured = drive_through(plan, self.plant, self._next_seed())
        return Record.of_traces(plan.name, drive, measured, kind=plan.name)

    def _next_seed(self) -> int:
        self._made += 1
        return self.seed + self._made - 1
