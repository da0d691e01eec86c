"""The evidence by Laplace's method, beside that by nested sampling of the same likelihood.

Records are those of drawn diagnoses. To each some sets of effects are fitted as the product does:
the true one, a part of it, or others.
"""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from attrs import frozen

from afm_scan_bench.any_lab.diagnosis import HEALTHY, calibrated, drawn, with_effect
from afm_scan_bench.diagnosis.prior import Prior, prior_of
from afm_scan_ros.core.diagnosis.axis_diagnosis import features_of
from afm_scan_ros.core.diagnosis.candidates import Candidate, CandidateFitter, FittedCandidates
from afm_scan_ros.core.diagnosis.cautions import with_healthy
from afm_scan_ros.core.diagnosis.fit import inserted
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.effects.registry import effect_type
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

Form = tuple[str, str]
"""Name of an effect, and kind of its form."""
GAIN, SOFTER = ("parameter_shift", "gain"), ("parameter_shift", "resonance")
SLEW, LAG, BACKLASH = ("slew_limit", ""), ("input_lag", ""), ("backlash", "")
SETS: Mapping[int, tuple[tuple[Form, ...], ...]] = {
    2: ((SLEW,), (LAG,), (SLEW, LAG)),
    6: ((GAIN, BACKLASH), (GAIN,)),
    8: ((SLEW,), (LAG,)),
    12: ((SOFTER,), (("extra_resonance", "absorber_mode"),)),
}
"""Sets of effects by the seed of a short record, a development case."""
POINTS, REMAINING = 300, 0.05
"""Live points of nested sampling, and the nats that it may leave."""
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
    rows = [row for seed in SETS for row in _rows(seed)]
    errors = np.abs([float(row["difference"]) for row in rows])
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
    truth, times, fitter = _drawn(seed)
    for forms in SETS[seed]:
        trial = _fitted(fitter, forms)
        by_laplace = trial.cells.log_likelihood + trial.fit.log_volume
        prior = prior_of(fitter, trial)
        found = nested(_likelihood(fitter, trial, prior), prior.at, len(prior.unknown))
        yield {
            "seed": seed,
            "truth": truth,
            "times": times,
            "effects": " + ".join(f"{name} {kind}".strip() for name, kind in forms),
            "numbers": len(prior.unknown),
            "laplace": by_laplace,
            "nested": found.evidence,
            "error": found.error,
            "difference": by_laplace - found.evidence,
            "missed": found.highest - trial.cells.log_likelihood,
        }


def _drawn(seed: int) -> tuple[str, float, CandidateFitter]:
    """Names and size of the effects that were drawn, and what fits effects to their record."""
    laboratory = calibrated(*drawn(seed))
    drives = [laboratory.scan() for _ in range(HEALTHY)]
    healthy, *_ = [laboratory.healthy_record(each) for each in drives]
    known = list(laboratory.known)
    model = with_healthy(laboratory.model.scanner, known)
    limit = evidence_of("x", model, healthy).limit.total
    truth, times, record = with_effect(laboratory, seed, drives[0], limit)
    evidence = evidence_of("x", model, record)
    return truth, times, CandidateFitter((evidence,), chain_of(model.axis("x")))


def _fitted(fitter: CandidateFitter, forms: tuple[Form, ...]) -> FittedCandidates:
    """Fit forms of effects one after the other, each beside those before."""
    trial: FittedCandidates | None = None
    for name, kind in forms:
        chain = trial.extended(fitter.chain) if trial else fitter.chain
        effect = effect_type(name)
        features = features_of(fitter.decimated_evidence, fitter.evidence, chain)
        begun = fitter.begin(trial, Candidate(effect, effect.form(kind)), features)
        trial = fitter.fit(begun) if begun else None
    if trial is None:
        raise ScanError(f"{forms} cannot be fitted")
    return trial


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
