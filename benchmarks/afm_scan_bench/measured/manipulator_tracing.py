"""What a micromanipulator's record holds beyond hysteresis, and the error before and after."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from afm_scan_bench.measured.micromanipulator.study import JUDGED, MICRO, SAMPLE_RATE, WITH_INVERSE
from afm_scan_bench.measured.micromanipulator.tracing_figure import manipulator_tracing_figure
from afm_scan_bench.measured.micromanipulator.tracing_study import Tracing
from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis
from afm_scan_ros.core.diagnosis.candidates import FittedCandidates
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

COLUMNS = {
    "effects": ("beside hysteresis", ""),
    "values": ("values", ""),
    "misfit": ("misfit", ".0f"),
    "taught_um": ("taught", ".3f"),
    "before_inverse_um": ("25.5 to 37.15 s", ".3f"),
    "with_inverse_um": ("38 to 70.75 s", ".3f"),
    "start_um": ("start", ".2f"),
}
"""``misfit`` is that of the search, on blocks that no fit saw, in floors squared; the rest is
rms in µm of models learnt from all that teaches: of what taught; of each judged span, its mean
removed; of the first half second of both files, which taught nothing."""
START = slice(0, SAMPLE_RATE // 2)
NO_INVERSE = slice(JUDGED[0].samples.start, JUDGED[1].samples.stop)


def measure() -> Table:
    """Trace, and judge each model that the search could not tell from the best."""
    tracing = Tracing()
    rows = [_row(tracing, *model) for model in models(tracing.trace)]
    picture = partial(manipulator_tracing_figure, tracing)
    return Table("manipulator_tracing", _title(tracing.trace), COLUMNS, rows, picture=picture)


def models(trace: AxisDiagnosis) -> Iterator[tuple[str, str, float, Chain]]:
    """Yield name, values, misfit and chain: none, the best alone, those kept, their rivals."""
    selection = trace.selection
    yield "nothing (declared)", "", selection.misfit_before, trace.chain
    found = [("alone", selection.first[0]), ("traced", selection.selected)]
    found += [("rival", competing.trial) for competing in selection.competing_models]
    for role, trial in found:
        if trial is not None:
            yield _named(role, trial), _values(trial), trial.misfit, trial.extended(trace.chain)


def spans(left: tuple[Array, Array], tracing: Tracing) -> dict[str, float]:
    """Rms errors (µm) of what a model left (m) of both files."""
    fitted = np.concatenate(
        [error[record.judged] for error, record in zip(left, tracing.records, strict=True)]
    )
    start = np.concatenate([error[START] for error in left])
    return {
        "taught_um": _rms(fitted),
        "before_inverse_um": float(np.std(left[1][NO_INVERSE])) / MICRO,
        "with_inverse_um": float(np.std(left[1][WITH_INVERSE.samples])) / MICRO,
        "start_um": _rms(start),
    }


def _row(tracing: Tracing, effects: str, values: str, misfit: float, chain: Chain) -> Row:
    errors = spans(tracing.left(tracing.learnt(chain)), tracing)
    return {"effects": effects, "values": values, "misfit": misfit, **errors}


def _named(role: str, trial: FittedCandidates) -> str:
    kinds = (
        f"{candidate.effect.name} {candidate.form.kind}".strip() for candidate in trial.candidates
    )
    return f"{role}: {', '.join(kinds)}"


def _values(trial: FittedCandidates) -> str:
    parameters = [p for candidate in trial.candidates for p in candidate.form.parameters]
    found = zip(parameters, trial.fit.values, trial.fit.halfwidth, strict=True)
    return ", ".join(f"{p.name} {value:.3g} ± {half:.1g} {p.unit}" for p, value, half in found)


def _title(trace: AxisDiagnosis) -> str:
    limits = " and ".join(f"{each.limit.total / MICRO:.3f}" for each in trace.evidence)
    largest = max(float(ratio.max()) for ratio in trace.ratio_after)
    return (
        "Piezo micromanipulator, data © 2019 Yan Naing Aye (MIT)\n"
        f"Declared: hysteresis alone. Verdict: {trace.verdict}; detection limits {limits} µm,\n"
        f"largest band of what is left {largest:.1f} times its detection limit. Errors in µm rms.\n"
        f"Experiments that would tell more: {', '.join(experiments(trace))}"
    )


def experiments(trace: AxisDiagnosis) -> tuple[str, ...]:
    """Experiments that tell those effects apart that were kept or could stand for them."""
    trials = [
        trace.selection.selected,
        *(competing.trial for competing in trace.selection.competing_models),
    ]
    named = (candidate for trial in trials if trial for candidate in trial.candidates)
    return tuple(dict.fromkeys(candidate.effect.experiment for candidate in named))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) / MICRO
