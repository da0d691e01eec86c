"""``afm-scan close-loop`` and ``learn``: scan, find what the model lacks, and scan again."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import click
from attrs import define, field

from afm_scan_ros.api.diagnosis import info_of, observation_of
from afm_scan_ros.api.record import read_record
from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.bag.scan_info import ScanInfo
from afm_scan_ros.cli.driving import DrivenScanner, run_calibration
from afm_scan_ros.cli.options import CONFIG, FILE, FOLDER, refuse_existing, working
from afm_scan_ros.cli.orders import ScanFiles
from afm_scan_ros.cli.scan import drive_limits_of, run_scan
from afm_scan_ros.cli.scanner import SIM, scanner_options, seed_option, time_scale_option
from afm_scan_ros.core.closed_loop import Round, validation_specs
from afm_scan_ros.core.closed_loop import close_loop as rounds_of
from afm_scan_ros.core.diagnosis.axis_diagnosis import SUFFICIENT
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis, diagnose
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.diagnosis.residual_report import report_residual
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.identification.drives.waveforms import Waveform
from afm_scan_ros.core.learning.correction import Correction
from afm_scan_ros.core.learning.loop import FEWEST, LearningScan, best_of, lacking, observations
from afm_scan_ros.core.learning.loop import learn as learning_scans
from afm_scan_ros.core.metrics import Scan, plain
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.learned_file import save_learned
from afm_scan_ros.files.model_file import load_model, model_hash, save_model
from afm_scan_ros.files.paths import write_text
from afm_scan_ros.files.plant_file import load_plant, load_scan, save_scan
from afm_scan_ros.nodes.flow import FLOW
from afm_scan_ros.report.close_loop import close_loop_page, final_text, reported, round_result
from afm_scan_ros.report.diagnosis_json import closed_loop_document, diagnosis_of, save_diagnosis
from afm_scan_ros.report.diagnosis_page import write_diagnosis
from afm_scan_ros.report.diagnosis_text import next_steps
from afm_scan_ros.report.html import Provenance, Source, heading_lines, provenance_of, source_of
from afm_scan_ros.report.learning import (
    Taught,
    learning_document,
    learning_page,
    learning_text,
    taught_text,
)
from afm_scan_ros.report.table import show
from afm_scan_ros.report.terminal import say

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


HEADING = "A scanner's model with the effects that 'afm-scan close-loop' identified."


@click.command()
@click.option(
    "--spec", type=FILE, default=CONFIG / "scan.yaml", help="Scan that is diagnosed and repeated."
)
@click.option("--model", type=FILE, default=CONFIG / "model.yaml", help="Model file to extend.")
@scanner_options
@click.option(
    "--out",
    required=True,
    type=FOLDER,
    help="Folder for report.html, diagnosis.json, model.extended.yaml, bags.",
)
@click.option(
    "--rounds",
    type=click.IntRange(min=1),
    default=3,
    show_default=True,
    help="Largest number of rounds.",
)
@seed_option
@time_scale_option
def close_loop(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    spec: Path,
    model: Path,
    plant: Path,
    scanner: str,
    out: Path,
    rounds: int,
    seed: int,
    time_scale: float | None,
) -> None:
    """Scan, diagnose what the model lacks, extend the model, and scan again with its inverse.

    The scan of --spec is diagnosed. It and three others are made before and after: another rate,
    another amplitude, another pattern. An extended model that makes any of them worse is not kept.
    """
    base = _base_model(model)
    diagnosed, _ = load_scan(spec, [parameter.name for parameter in FLOW])
    if scanner == SIM:
        load_plant(plant)
    refuse_existing(out / "bags")
    session = RecordedSession(plant, out, seed, scanner, time_scale)
    done: list[Round] = []

    def provenance(records: Sequence[Source]) -> Provenance:
        return provenance_of(model, base, records, datetime.now(UTC))

    try:
        for each in rounds_of(session, base, validation_specs(diagnosed), rounds, _diagnose):
            done.append(each)
            say(f"round {len(done)}: {each.diagnosis.verdict.replace('_', ' ')}")
            show(round_result(each))
            of = provenance(_diagnosed(each, session.sources))
            write_diagnosis(
                out / f"round_{len(done)}", report_residual(each.diagnosis), HEADING, of
            )
    except (InputError, ScanError) as error:
        if done:
            _conclude(out, done, provenance(session.sources), failure=str(error))
        raise
    _conclude(out, done, provenance(session.sources))
    first = done[0]
    if not first.improved and first.diagnosis.verdict != SUFFICIENT:
        raise ScanError(_shortcoming(first))


def _diagnosed(done: Round, recorded: Sequence[Source]) -> list[Source]:
    """Return the records that a round's diagnosis used."""
    names = {Path(observed.name).name for observed in done.diagnosis.observations}
    return [source for source in recorded if Path(source.bag).name in names]


def _base_model(path: Path) -> ScannerModel:
    """Load a model that states its discrepancy, which the detection limit needs."""
    model = load_model(path)
    for axis in AXES:
        if axis not in model.axes:
            raise InputError(f"{path}: holds no axis {axis}, which a scan moves: identify it too")
        if not model.axis(axis).model_discrepancies:
            raise InputError(
                f"{path}: {axis}: model_discrepancy is missing: identify the scanner again, with a"
                " validation record"
            )
    return model


def _diagnose(model: ScannerModel, records: Sequence[Observation]) -> ScannerDiagnosis:
    with working("diagnosing") as progress:
        return diagnose(model, records, progress)


def _conclude(out: Path, done: Sequence[Round], of: Provenance, failure: str = "") -> None:
    """Write and print the results of the rounds; ``failure`` is what ended the next, if any."""
    made = {"provenance": plain(of)}
    save_diagnosis(out / "diagnosis.json", {**diagnosis_of(done), **made})
    save_diagnosis(out / "closed_loop.json", {**closed_loop_document(done, failure), **made})
    write_text(out / "report.html", close_loop_page(done, of, failure))
    kept = [each.diagnosis.model for each in done if each.kept]
    model, head = kept[-1] if kept else done[0].model, f"{HEADING}\n{heading_lines(of)}"
    save_model(out / "model.extended.yaml", model, head)
    show(final_text(done, failure))
    show(f"next: {step}" for step in next_steps(reported(done).diagnosis))
    say(f"Report: {out / 'report.html'}. JSON, models and bags are in the same folder.")


def _shortcoming(done: Round) -> str:
    found = done.diagnosis
    steps = "; ".join(next_steps(found)) or "see the report"
    verdict = found.verdict.replace("_", " ")
    return f"no extended model reduced the tracking error; verdict {verdict}: {steps}"


LEARN_HEADING = "A scanner's model with the effects that 'afm-scan learn' identified."
DEFAULT_SCANS = 6


@click.command()
@click.option("--spec", type=FILE, default=CONFIG / "scan.yaml", help="Scan that is repeated.")
@click.option("--model", type=FILE, default=CONFIG / "model.yaml", help="Model file to invert.")
@scanner_options
@click.option(
    "--scans",
    type=click.IntRange(min=FEWEST),
    default=DEFAULT_SCANS,
    show_default=True,
    help="Number of scans; the first two have no correction.",
)
@click.option(
    "--out", required=True, type=FOLDER, help="Folder for learned.npz, report.html, bags."
)
@click.option(
    "--diagnose", "diagnosed", is_flag=True, help="Diagnose what the model lacks by the scans."
)
@seed_option
@time_scale_option
def learn(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    spec: Path,
    model: Path,
    plant: Path,
    scanner: str,
    scans: int,
    out: Path,
    seed: int,
    time_scale: float | None,
    *,
    diagnosed: bool,
) -> None:
    """Repeat a scan, and learn a correction of its reference from the measured errors.

    learned.npz holds the correction of the best scan. 'afm-scan scan --learned' uses it. It
    belongs to this scan and this model.
    """
    base = load_model(model)
    for axis in AXES:
        base.axis(axis)
    wanted, _ = load_scan(spec, [parameter.name for parameter in FLOW])
    limits = drive_limits_of(scanner, plant)
    refuse_existing(out / "bags")
    session = RecordedSession(plant, out, seed, scanner, time_scale)
    done: list[LearningScan] = []
    failure, ended = "", None
    try:
        for each in learning_scans(session, base, wanted, scans, limits):
            done.append(each)
            errors = ", ".join(f"{axis} {1e9 * each.errors[axis]:.1f} nm" for axis in AXES)
            say(f"scan {len(done)} of {scans}: measured error, rms: {errors}")
    except (InputError, ScanError, KeyboardInterrupt) as error:
        if not done:
            raise
        ended = error
        failure = str(error) or "interrupted"
    made = provenance_of(model, base, session.sources, datetime.now(UTC))
    save_learned(out / "learned.npz", best_of(done).correction, base)
    _write(out, done, None, made, failure)
    show(learning_text(done))
    if diagnosed and not failure:
        taught = _taught(base, done, out, made)
        _write(out, done, taught, made, failure)
        show(taught_text(taught))
    say(f"Report: {out / 'report.html'}. Correction: {out / 'learned.npz'}.")
    if isinstance(ended, KeyboardInterrupt):
        raise ended
    if failure:
        raise ScanError(f"learning ended after {len(done)} scans: {failure}")


def _taught(model: ScannerModel, done: list[LearningScan], out: Path, of: Provenance) -> Taught:
    """Diagnose the first scan and the learned one together."""
    with working("diagnosing") as progress:
        found = diagnose(model, observations(done), progress)
    best = best_of(done)
    head = f"{LEARN_HEADING}\n{heading_lines(of)}"
    save_model(out / "model.extended.yaml", found.model, head)
    return Taught(found, lacking(model, best), lacking(found.model, best))


def _write(
    out: Path, done: list[LearningScan], taught: Taught | None, of: Provenance, failure: str
) -> None:
    """Write what was learned; ``failure`` is what ended it, if any."""
    document = {**learning_document(done, taught), "failure": failure, "provenance": plain(of)}
    save_diagnosis(out / "learning.json", document)
    write_text(out / "report.html", learning_page(done, taught, of, failure))
