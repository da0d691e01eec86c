"""What a micromanipulator's record holds beyond hysteresis, and the error before and after."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from afm_scan_bench.measured.micromanipulator.diagnosis_figure import manipulator_diagnosis_figure
from afm_scan_bench.measured.micromanipulator.diagnosis_study import ManipulatorDiagnosis
from afm_scan_bench.measured.micromanipulator.study import JUDGED, MICRO, SAMPLE_RATE, WITH_INVERSE
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import CERTAIN, AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "effects": ("beside hysteresis", ""),
    "values": ("values", ""),
    "log_posterior": ("log posterior, nats", ".0f"),
    "development_um": ("development", ".3f"),
    "before_inverse_um": ("25.5 to 37.15 s", ".3f"),
    "with_inverse_um": ("38 to 70.75 s", ".3f"),
    "start_um": ("start", ".2f"),
}
"""``log_posterior`` is relative to a residual of zero. Errors are rms, in µm, of models fitted to
all development data. They are stated for the development data, for each held-out span without its
mean, and for the first half second of both files, held out too."""
START = slice(0, SAMPLE_RATE // 2)
NO_INVERSE = slice(JUDGED[0].samples.start, JUDGED[1].samples.stop)


def measure() -> Table:
    """Diagnose, and state the errors of each competing model."""
    study = ManipulatorDiagnosis()
    rows = [_row(study, *model) for model in models(study.diagnosis)]
    picture = partial(manipulator_diagnosis_figure, study)
    return Table("manipulator_diagnosis", _title(study.diagnosis), COLUMNS, rows, picture=picture)


def models(diagnosis: AxisDiagnosis) -> Iterator[tuple[str, str, float, Chain]]:
    """Yield name, values, log posterior and chain: base model, best single, selected, competing."""
    selection = diagnosis.selection
    posterior = selection.posterior
    yield "nothing (base model)", "", selection.without.log_likelihood, diagnosis.chain
    alone = max(
        (trial for names, trial in posterior.best.items() if len(names) == 1),
        key=lambda trial: trial.log_posterior,
    )
    found = [("alone", alone), ("selected", selection.selected)]
    found += [("competing", trial) for trial in posterior.competing(CERTAIN)]
    for role, trial in found:
        if trial is not None:
            chain = trial.extended(diagnosis.chain)
            yield _named(role, trial), _values(trial), trial.log_posterior, chain


def spans(left: tuple[Array, Array], study: ManipulatorDiagnosis) -> dict[str, float]:
    """Rms errors (µm) of what a model left (m) of both files."""
    fitted = np.concatenate(
        [error[record.judged] for error, record in zip(left, study.records, strict=True)]
    )
    start = np.concatenate([error[START] for error in left])
    return {
        "development_um": _rms(fitted),
        "before_inverse_um": float(np.std(left[1][NO_INVERSE])) / MICRO,
        "with_inverse_um": float(np.std(left[1][WITH_INVERSE.samples])) / MICRO,
        "start_um": _rms(start),
    }


def _row(
    study: ManipulatorDiagnosis, effects: str, values: str, log_posterior: float, chain: Chain
) -> Row:
    errors = spans(study.left(study.learnt(chain)), study)
    return {"effects": effects, "values": values, "log_posterior": log_posterior, **errors}


def _named(role: str, trial: FittedCandidates) -> str:
    kinds = (
        f"{candidate.effect.name} {candidate.form.kind}".strip() for candidate in trial.candidates
    )
    return f"{role}: {', '.join(kinds)}"


def _values(trial: FittedCandidates) -> str:
    parameters = [p for candidate in trial.candidates for p in candidate.form.parameters]
    found = zip(parameters, trial.fit.values, trial.fit.halfwidth, strict=True)
    return ", ".join(f"{p.name} {value:.3g} ± {half:.1g} {p.unit}" for p, value, half in found)


def _title(diagnosis: AxisDiagnosis) -> str:
    limits = " and ".join(f"{each.limit.total / MICRO:.3f}" for each in diagnosis.evidence)
    largest = max(float(ratio.max()) for ratio in diagnosis.ratio_after)
    return (
        "Piezo micromanipulator, data © 2019 Yan Naing Aye (MIT)\n"
        "Base model: hysteresis alone. Errors in µm rms.\n"
        f"Verdict: {diagnosis.verdict}; detection limits {limits} µm;\n"
        f"largest band of the residual: {largest:.1f} times its detection limit.\n"
        f"Experiments that would resolve it: {', '.join(experiments(diagnosis))}"
    )


def experiments(diagnosis: AxisDiagnosis) -> tuple[str, ...]:
    """Experiments that distinguish the selected and the competing effects."""
    trials = [
        diagnosis.selection.selected,
        *diagnosis.selection.posterior.competing(CERTAIN),
    ]
    named = (candidate for trial in trials if trial for candidate in trial.candidates)
    return tuple(dict.fromkeys(candidate.effect.experiment for candidate in named))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) / MICRO
