"""The closed loop in rounds: scan, diagnose, extend the model, and scan again.

The model is fitted to one scan; three others, which validate it, differ in rate, amplitude and
pattern.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Protocol

from attrs import evolve, frozen

from afm_scan_ros.core.comparison import ScanComparison, compare_scans
from afm_scan_ros.core.diagnosis.axis_diagnosis import AMBIGUOUS, INSUFFICIENT
from afm_scan_ros.core.diagnosis.diagnosis import ScannerDiagnosis
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import Plan
from afm_scan_ros.core.metrics import Scan
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import TO_AND_FRO
from afm_scan_ros.core.types import AXES

FIRST = "same"
FAST_LINE_RATE = 20.0
"""Line rate, Hz, above which the other rate is half of it and not twice: the drive has limits."""


def validation_specs(spec: ScanSpec) -> dict[str, ScanSpec]:
    """Return a scan, and that of another rate, amplitude and pattern, at one sample period."""
    return {
        FIRST: spec,
        "rate": _other_rate(spec),
        "amplitude": evolve(spec, range_x=0.5 * spec.range_x, range_y=0.5 * spec.range_y),
        "pattern": _other_pattern(spec),
    }


def _other_rate(spec: ScanSpec) -> ScanSpec:
    if spec.line_rate > FAST_LINE_RATE:
        return evolve(
            spec, line_rate=0.5 * spec.line_rate, samples_per_line=2 * spec.samples_per_line
        )
    samples = 2 * (spec.samples_per_line // 4)  # even, so that trace and retrace are alike
    return evolve(
        spec,
        line_rate=spec.line_rate * spec.samples_per_line / samples,
        samples_per_line=samples,
        y_step=min(spec.y_step, 0.25 / spec.line_rate),
    )


def _other_pattern(spec: ScanSpec) -> ScanSpec:
    if spec.pattern in TO_AND_FRO:
        return evolve(spec, pattern="spiral")
    return evolve(spec, pattern="raster", y_step=min(spec.y_step, 0.5 / spec.line_rate))


MOST_EXPERIMENTS = 2
"""Experiments in a round, at most."""

Scans = Mapping[str, Scan]
Diagnose = Callable[[ScannerModel, Sequence[Record]], ScannerDiagnosis]


class ScannerSession(Protocol):
    """A scanner that makes scans, and experiments that resolve an ambiguity."""

    def scan(self, label: str, spec: ScanSpec, model: ScannerModel) -> Scan:
        """Scan with all of a model's inverses; raises InputError or ScanError where it cannot."""
        ...

    def experiment(self, plan: Plan) -> Record:
        """Drive the scanner through an experiment, which the plan is named after."""
        ...


@frozen(eq=False)
class Round:
    """What the diagnosis found, and how the scans with the extended model compare.

    ``model`` made the scans ``before``; ``experiments`` were recorded in this round. ``after`` and
    ``comparisons`` are empty where nothing new was found, or no scan could be made: ``refusal``.
    """

    model: ScannerModel
    diagnosis: ScannerDiagnosis
    experiments: tuple[str, ...]
    before: Scans
    after: Scans
    comparisons: Mapping[str, ScanComparison]
    refusal: str = ""

    @property
    def worse(self) -> dict[tuple[str, str], float]:
        """ScanComparison and axis of each error that grew, and how many times."""
        return {
            (name, axis): ratio
            for name, trial in self.comparisons.items()
            for axis, ratio in trial.worse.items()
        }

    @property
    def kept(self) -> bool:
        """Whether the extended model replaces the model: it can scan, and no error grew."""
        return bool(self.comparisons) and not self.worse

    @property
    def improved(self) -> bool:
        """Whether the extended model is kept and follows the scan it was fitted to better."""
        return self.kept and self.comparisons[FIRST].better


def close_loop(
    session: ScannerSession,
    model: ScannerModel,
    comparisons: Mapping[str, ScanSpec],
    rounds: int,
    diagnose: Diagnose,
) -> Iterator[Round]:
    """Yield rounds until one finds nothing more, makes nothing better, or is the last.

    Each diagnoses ``model`` on the fitted scans of all models so far, and on the experiments.
    """
    believed, scans = model, _scans(session, model, comparisons, 0)
    fitted: list[Record] = []
    experiments: dict[str, Record] = {}
    for number in range(1, rounds + 1):
        scan = scans[FIRST]
        fitted.append(
            Record.of_traces(f"{FIRST}_{number - 1}", scan.drive, scan.measured, scan.spec)
        )
        known = len(experiments)
        *_, found = diagnose_until_resolved(session, model, fitted, experiments, diagnose)
        done = _repeated(session, believed, found, tuple(experiments)[known:], scans, number)
        yield done
        if not done.improved:
            return
        believed, scans = found.model, done.after


def diagnose_until_resolved(
    session: ScannerSession,
    model: ScannerModel,
    fitted: Sequence[Record],
    experiments: dict[str, Record],
    diagnose: Diagnose,
) -> Iterator[ScannerDiagnosis]:
    """Diagnose; while the verdict is open, add the proposed experiment to ``experiments``."""
    yield (found := diagnose(model, [*fitted, *experiments.values()]))
    for _ in range(MOST_EXPERIMENTS):
        wanted = found.proposal
        if found.verdict not in (AMBIGUOUS, INSUFFICIENT) or wanted is None:
            break
        experiment = wanted.experiment
        if experiment.name in experiments:
            break
        experiments[experiment.name] = session.experiment(experiment.plan_for(model))
        yield (found := diagnose(model, [*fitted, *experiments.values()]))


def _repeated(
    session: ScannerSession,
    model: ScannerModel,
    found: ScannerDiagnosis,
    experiments: tuple[str, ...],
    before: Scans,
    number: int,
) -> Round:
    if _added(found.model) == _added(model):
        return Round(model, found, experiments, before, {}, {})
    specs = {name: scan.spec for name, scan in before.items()}
    try:
        after = _scans(session, found.model, specs, number)
    except (InputError, ScanError) as error:
        return Round(model, found, experiments, before, {}, {}, str(error))
    comparisons = {
        name: compare_scans(model, found.model, before[name], after[name]) for name in specs
    }
    return Round(model, found, experiments, before, after, comparisons)


def _added(model: ScannerModel) -> Counter[tuple[str, str, str]]:
    """Count axis, name and kind of each effect added to a model."""
    return Counter((axis, e.name, e.kind) for axis in AXES for e in model.axis(axis).added)


def _scans(
    session: ScannerSession, model: ScannerModel, comparisons: Mapping[str, ScanSpec], number: int
) -> Scans:
    return {
        name: session.scan(f"{name}_{number}", spec, model) for name, spec in comparisons.items()
    }
