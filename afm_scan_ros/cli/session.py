"""A scanner driven through scans and experiments by a command that repeats them."""

from pathlib import Path

from attrs import define, field

from afm_scan_ros.api.diagnosis import info_of, observation_of
from afm_scan_ros.api.record import read_record
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.cli.scanner import SIM
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.waveforms import Waveform
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.learned_file import save_learned
from afm_scan_ros.files.model_file import model_hash, save_model
from afm_scan_ros.files.plant_file import save_scan
from afm_scan_ros.report.provenance import Source, source_of

SIGNALS = ("desired_displacement", "drive_voltage", "achieved_displacement")
TRUE = "true_displacement"


@define
class RecordedSession:
    """A scanner as the commands' options name it; ``bags``, ``specs``, ``models`` go to ``out``.

    ``plant`` and ``seed`` are of the ``scanner`` sim, whose noise is another each time. It becomes
    older by what it has scanned so far.
    ``time_scale`` is 1 for real time; None is the scanner's own. ``sources`` list what was recorded
    so far.
    """

    plant: Path
    out: Path
    seed: int
    scanner: str = SIM
    time_scale: float | None = None
    sources: list[Source] = field(factory=list, init=False)
    _made: int = field(default=0, init=False)
    _age: float = field(default=0.0, init=False)

    def scan(
        self, label: str, spec: ScanSpec, model: ScannerModel, correction: Correction | None = None
    ) -> Scan:
        """Scan with all of a model's inverses, and a correction of the reference, if any.

        Raises ScanError where that cannot be.
        """
        bag = self.out / "bags" / label
        spec_file = self.out / "specs" / f"{label}.yaml"
        save_scan(spec_file, spec, f"The scan recorded in bags/{label}.")
        learned = None
        if correction is not None:
            learned = self.out / "learned" / f"{label}.npz"
            save_learned(learned, correction, model)
        model_file = self._model_file(model)
        files = ScanFiles(spec_file, model_file, self.plant, bag, self.scanner, learned)
        further: dict[str, dict[str, object]] = {}
        if self.scanner == SIM:
            further["piezoscanner_sim"] = {"seed": self._next_seed(), "age_s": self._age}
        run_scan(files, INVERSES, self.time_scale, further)
        recording = read_scan(bag)
        names = [*SIGNALS, TRUE] if TRUE in recording.topics else SIGNALS
        signals = [recording.whole(name) for name in names]
        self._state(bag, recording.info, len(signals[0].x))
        return Scan(spec, *signals)

    def experiment(self, plan: Plan[Waveform]) -> Observation:
        """Drive the scanner through an experiment, which the plan is named after."""
        bag = self.out / "bags" / plan.name
        driven = DrivenScanner(
            self.scanner, self.plant, self._next_seed(), self.time_scale, self._age
        )
        run_calibration(driven, bag.parent, [plan])
        record = read_record(bag)
        self._state(bag, info_of(record), len(record.drive))
        return observation_of(record)

    def _state(self, bag: Path, info: ScanInfo, samples: int) -> None:
        self.sources.append(source_of(str(bag), info, samples))
        self._age += samples * info.sample_period

    def _model_file(self, model: ScannerModel) -> Path:
        path = self.out / "models" / f"{model_hash(model)[:12]}.yaml"
        if not path.exists():
            save_model(path, model, "A model that scans were made with.")
        return path

    def _next_seed(self) -> int:
        self._made += 1
        return self.seed + self._made - 1
