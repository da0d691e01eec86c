"""The evidence by Laplace's method, beside that by nested sampling of the same likelihood.

Records are those of drawn diagnoses. Of each the product's own search gives the effects: the best
set of the true effects, two other sets as large, and the best set with an effect more.
"""

from collections.abc import Callable, Iterator

import numpy as np
from attrs import frozen

from afm_scan_bench.any_lab.diagnoses import HEALTHY, calibrated, drawn, with_effect
from afm_scan_bench.any_lab.effects import EVERY
from afm_scan_bench.any_lab.outcomes import names_of
from afm_scan_bench.diagnosis.prior import Prior, prior_of
from afm_scan_ros.api.diagnosis import observation_of
from afm_scan_ros.core.diagnosis.axis_diagnosis import AxisDiagnosis, diagnose_axis
from afm_scan_ros.core.diagnosis.candidates import CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.fit import inserted
from afm_scan_ros.core.diagnosis.healthy import with_healthy
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

SEEDS = (2,)
"""Drawn diagnoses whose records are short; all are development cases."""
POINTS, REMAINING = 300, 0.05
"""Live points of nested sampling, and the nats that it may leave."""
MOST_NUMBERS = 6
IMPOSSIBLE = -1e300

COLUMNS = {
    "seed": ("seed", "d"),
    "truth": ("true", ""),
    "times": ("times the limit", ".1f"),
    "effects": ("effects", ""),
    "numbers": ("numbers", "d"),
    "laplace": ("Laplace, nats", ".2f"),
    "nested": ("nested, nats", ".2f"),
    "error": ("its error", ".2f"),
    "difference": ("Laplace - nested", ".2f"),
    "missed": ("likelihood above that of the fit", ".2f"),
}


def measure() -> Table:
    """Compare both for the sets of effects of each record."""
    rows = [row for seed in SEEDS for row in _rows(seed)]
    errors = np.abs([float(row["difference"]) for row in rows])  # type: ignore[arg-type]
    title = (
        f"Log evidence by Laplace's method and by nested sampling, {len(rows)} sets of effects\n"
        f"difference: median {np.median(errors):.2f}, largest {errors.max():.2f} nats"
    )
    return Table("laplace", title, COLUMNS, rows)


@frozen
class Nested:
    """Log evidence (nats) and its standard error; ``highest`` is the largest log likelihood."""

    evidence: float
    error: float
    highest: float


def nested(
    log_likelihood: Callable[[Array], float], transform: Callable[[Array], Array], numbers: int
) -> Nested:
    """Integrate a likelihood over a prior, which ``transform`` makes of the unit cube.

    Raises InputError where dynesty is missing.
    """
    try:
        from dynesty import NestedSampler  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise InputError(f"{error}: pip install './benchmarks[nested]'") from error
    rng = np.random.default_rng(1)
    sampler = NestedSampler(log_likelihood, transform, numbers, nlive=POINTS, rstate=rng)
    sampler.run_nested(dlogz=REMAINING, print_progress=False)
    found = sampler.results
    return Nested(float(found.logz[-1]), float(found.logzerr[-1]), float(found.logl.max()))


def _rows(seed: int) -> Iterator[Row]:
    truth, times, diagnosed = _diagnosed(seed)
    fitter = CandidateFitter(diagnosed.evidence, diagnosed.chain)
    for trial in _chosen(diagnosed, {EVERY[name].name for name in names_of(truth)}):
        by_laplace = trial.bands.log_likelihood + trial.fit.log_volume
        prior = prior_of(fitter, trial)
        found = nested(_likelihood(fitter, trial, prior), prior.at, len(prior.unknown))
        yield {
            "seed": seed,
            "truth": truth,
            "times": times,
            "effects": " + ".join(f"{c.effect.name} {c.form.kind}" for c in trial.candidates),
            "numbers": len(prior.unknown),
            "laplace": by_laplace,
            "nested": found.evidence,
            "error": found.error,
            "difference": by_laplace - found.evidence,
            "missed": found.highest - trial.bands.log_likelihood,
        }


def _diagnosed(seed: int) -> tuple[str, float, AxisDiagnosis]:
    """Names and size of the effects that were drawn, and the product's diagnosis."""
    laboratory = calibrated(*drawn(seed))
    drives = [laboratory.scan() for _ in range(HEALTHY)]
    healthy, *_ = [laboratory.healthy_record(each) for each in drives]
    known = [observation_of(each) for each in laboratory.known]
    model = with_healthy(laboratory.model.scanner, known)
    limit = evidence_of("x", model, observation_of(healthy)).limit.total
    truth, times, record = with_effect(laboratory, seed, drives[0], limit)
    return truth, times, diagnose_axis("x", model, [observation_of(record)], lambda _: None)


def _chosen(diagnosed: AxisDiagnosis, truth: set[str]) -> Iterator[FittedCandidates]:
    """Yield the best trial of the truth, two of other sets as large, and one of a larger set."""
    ranked = sorted(diagnosed.selection.trials, key=lambda trial: -trial.log_posterior)
    few = [trial for trial in ranked if _quick(trial)]
    right = [trial for trial in few if set(trial.names) == truth]
    wrong = [t for t in few if set(t.names) != truth and len(t.names) == max(len(truth), 1)]
    more = [trial for trial in few if len(trial.names) > len(truth)]
    yield from (*right[:1], *wrong[:2], *more[:1])


def _quick(trial: FittedCandidates) -> bool:
    """Whether few numbers are fitted, and the hysteresis is as it was."""
    places = {place for candidate in trial.candidates for place in candidate.form.places}
    return trial.fit.rows.size <= MOST_NUMBERS and "hysteresis" not in places


def _likelihood(
    fitter: CandidateFitter, trial: FittedCandidates, prior: Prior
) -> Callable[[Array], float]:
    forms = [candidate.form for candidate in trial.candidates]

    def at(unknown: Array) -> float:
        values = prior.values(unknown)
        if not prior.allows(values):
            return IMPOSSIBLE
        try:
            chain = inserted(fitter.chain, forms, prior.layout.rows(values))
            return fitter.likelihood.fit(chain).log_likelihood
        except (InputError, ScanError):
            return IMPOSSIBLE

    return at
