"""Drives the scanner of --scanner: through plans, also grown while watched, and through scans."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import click
from attrs import define, evolve, field, frozen

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.record import read_record
from afm_scan_ros.cli.execution import execute_record
from afm_scan_ros.cli.options import grouped, refuse_existing
from afm_scan_ros.cli.orders import RecordOrder, ScanFiles, refuse_pace
from afm_scan_ros.cli.plan import covered
from afm_scan_ros.cli.processes import setting_aside
from afm_scan_ros.cli.scan import run_scan
from afm_scan_ros.cli.scanner import (
    PLANT,
    SIM,
    amplifier_of,
    choose,
    exchange_of,
    pace_of,
    record_by_files,
    scanner_options,
    time_scale_option,
)
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.identification.drives import proposal
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.identification.drives.experiments import peak
from afm_scan_ros.core.identification.drives.growth import (
    GrowthStep,
    MotionLimits,
    beyond,
    grow,
)
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_info import ScanInfo
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES, Trace
from afm_scan_ros.diagnosis import info_of
from afm_scan_ros.files.drive_files import save_learned
from afm_scan_ros.files.model_file import model_hash, save_model
from afm_scan_ros.files.plant_file import save_scan
from afm_scan_ros.report import plan_text
from afm_scan_ros.report.page import Source, source_of
from afm_scan_ros.report.table import Row


@frozen
class DrivenScanner:
    """A scanner as the commands' options name it; ``plant``, ``seed``, ``age`` are of the ``sim``.

    ``time_scale`` is 1 for real time; None is the scanner's own. ``age`` (s) is the time since it
    was switched on.
    """

    scanner: str = SIM
    plant: Path = PLANT
    seed: int = 1
    time_scale: float | None = None
    age: float = 0.0

    @property
    def limits(self) -> DriveLimits | None:
        """Limits of its amplifier; None for an external one, which does not state them."""
        amplifier = amplifier_of(self.scanner, self.plant)
        return None if amplifier is None else amplifier.limits

    @property
    def own(self) -> Mapping[str, object]:
        """Parameters of the simulated scanner; none of another."""
        return {"seed": self.seed, "age_s": self.age} if self.scanner == SIM else {}

    @property
    def options(self) -> tuple[object, ...]:
        """Options of a command that drives this scanner; none for the usual simulated one."""
        if self.scanner != SIM:
            return "--scanner", self.scanner
        return ("--plant", self.plant) if self.plant != PLANT else ()

    def record(self, plan: Plan, bag: Path, title: str) -> None:
        """Drive the scanner through a plan, and record it in a bag.

        Raises InputError before it begins, ScanError where the record stays incomplete.
        """
        if exchange := exchange_of(self.scanner):
            record_by_files(exchange, plan, bag)
            return
        time_scale = pace_of(self.scanner) if self.time_scale is None else self.time_scale
        refuse_pace(time_scale)
        chosen = choose(self.scanner, self.plant)
        if chosen.limits is not None:
            drive = excitation_block(plan, 0, plan.total_samples)
            chosen.limits.refuse_beyond(drive, dict.fromkeys(AXES, 0.0))
        execute_record(RecordOrder(plan, bag, f"{title}, to {bag}", chosen, time_scale, self.own))


driven_options = grouped(
    "driven",
    DrivenScanner,
    scanner_options,
    click.option("--seed", default=1, show_default=True, help="Seed of the sensor noise."),
    time_scale_option,
)
"""A scanner, which the command gets as ``driven``."""


def run_calibration(scanner: DrivenScanner, out: Path, plans: Iterable[Plan]) -> None:
    """Record each plan, as ``creep``, in a bag of its name in ``out``.

    Raises InputError before the first begins, ScanError where one stays incomplete; all bags are
    then set aside.
    """
    bags = {out / plan.name: plan for plan in plans}
    refuse_existing(*bags)
    out.mkdir(parents=True, exist_ok=True)
    with setting_aside(bags):
        for number, (bag, plan) in enumerate(bags.items(), 1):
            scanner.record(plan, bag, f"{plan.name} record, {number} of {len(bags)}")


SIGNALS = ("desired_displacement", "drive_voltage", "achieved_displacement")
TRUE = "true_displacement"


@define
class RecordedSession:
    """A scanner that scans again and again; ``bags``, ``specs``, ``models`` go to ``out``.

    The noise of the simulated one is another each time, and it becomes older by what it has scanned
    so far. ``sources`` list what was recorded so far.
    """

    scanner: DrivenScanner
    out: Path
    sources: list[Source] = field(factory=list, init=False)

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
        of = self._once()
        files = ScanFiles(spec_file, self._model_file(model), of.plant, bag, of.scanner, learned)
        further = {"piezoscanner_sim": of.own} if of.own else {}
        run_scan(files, INVERSES, of.time_scale, further)
        recording = read_scan(bag)
        names = [*SIGNALS, TRUE] if TRUE in recording.topics else SIGNALS
        signals = [recording.whole(name) for name in names]
        self._recorded(bag, recording.info, len(signals[0].x))
        return Scan(spec, *signals)

    def experiment(self, plan: Plan) -> Record:
        """Drive the scanner through an experiment, which the plan is named after."""
        bag = self.out / "bags" / plan.name
        run_calibration(self._once(), bag.parent, [plan])
        record = read_record(bag)
        self._recorded(bag, info_of(record), len(record.drive))
        return record

    def _once(self) -> DrivenScanner:
        """Return the scanner for one run; in the next one the noise is another."""
        now = self.scanner
        self.scanner = evolve(now, seed=now.seed + 1)
        return now

    def _recorded(self, bag: Path, info: ScanInfo, samples: int) -> None:
        self.sources.append(source_of(str(bag), info, samples))
        self.scanner = evolve(self.scanner, age=self.scanner.age + samples * info.sample_period)

    def _model_file(self, model: ScannerModel) -> Path:
        path = self.out / "models" / f"{model_hash(model)[:12]}.yaml"
        if not path.exists():
            save_model(path, model, "A model that scans were made with.")
        return path


ORDER = ("resonance", "creep", "hysteresis", "error")
"""What records identify, in the order in which they are taken: the gain is known early."""
RECORDS = ("survey", "creep", "hysteresis", "validation")
TRIALS = "trials"
"""Folder of the bags of small drives."""
ROUNDING = 1e-6
"""Share of a slope by which its computation may differ."""


@frozen
class PlannedCalibration:
    """A calibration of a scanner whose bags go to ``out``.

    ``limits`` are those of its amplifier, where they are known; ``hold`` is in s, ``scan_range`` in
    m.
    """

    scanner: DrivenScanner
    out: Path
    converter: proposal.ConverterLimits
    limits: DriveLimits | None
    motion: MotionLimits
    scan_range: float
    hold: float | None
    have: proposal.Coverage
    _rows: list[Row] = field(factory=list, init=False)

    def run(self) -> list[Path]:
        """Record what is lacking, print each step, and return the bags of the records.

        Raises InputError and ScanError as ``propose``, ``grow`` and the scanner do; all that was
        recorded stays.
        """
        refuse_existing(*(self.out / name for name in (*RECORDS, TRIALS)))
        bags: list[Path] = []
        have = self.have
        try:
            while record := self._next(have, {bag.name for bag in bags}):
                self._grow(record, have)
                bags.append(self.out / record.plan.name)
                have = proposal.combined([have, covered(bags[-1])])
        finally:
            if self._rows:
                table = plan_text.growth_table(self._rows)
                table.show()
                table.save(self.out)
        return bags

    def _next(self, have: proposal.Coverage, done: set[str]) -> proposal.ProposedRecord | None:
        proposed = proposal.propose(self.converter, self.hold, self.scan_range, have)
        if have.travel >= self.motion.nearly * self.motion.travel:
            done = {*done, "hysteresis"}
        lacking = [record for record in proposed if record.plan.name not in done]
        return min(lacking, key=lambda record: ORDER.index(record.identifies), default=None)

    def _grow(self, record: proposal.ProposedRecord, have: proposal.Coverage) -> None:
        """Take a record, as large as the slew limit and the response allow."""
        name = record.plan.name
        steepest = record.steepest
        if self.limits is not None and steepest > self.limits.slew:
            share = (1.0 - ROUNDING) * self.limits.slew / steepest
            click.echo(plan_text.slope_text(name, share, steepest, self.limits.slew))
            record = record.scaled(share)
        largest = peak(record.plan)
        for number, watched in enumerate(grow(record, self._drive, self.motion, have), 1):
            click.echo(plan_text.step_text(name, number, largest, watched))
        click.echo(plan_text.kept_text(name, watched.step))
        for reached in beyond(watched, self.motion):
            click.echo(plan_text.beyond_text(name, reached))
        self._rows.append(plan_text.growth_row(name, largest, watched))

    def _drive(self, plan: Plan, step: GrowthStep) -> tuple[Trace, Trace]:
        name = plan.name if step.whole else f"{plan.name}_{1e3 * step.share:04.0f}"
        bag = self.out / name if step.whole else self.out / TRIALS / name
        bag.parent.mkdir(parents=True, exist_ok=True)
        title = f"{plan.name} record" if step.whole else f"{plan.name}, {step.share:.1%} of it"
        with setting_aside([bag]):
            self.scanner.record(plan, bag, title)
        recording = read_scan(bag)
        return recording.whole("drive_voltage"), recording.whole("achieved_displacement")
