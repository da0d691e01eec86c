"""What general methods of sparse regression find in the residuals that are diagnosed.

Records are those of drawn diagnoses: of each seed, healthy scans and one with an effect. pysindy
and SysIdentPy get the residual and a library of polynomials of position, speed, time and the sign
of the speed. Each selects terms as its documentation advises. The largest term stands for an
effect where there is one of that form.

Needs ``pip install './benchmarks[rivals]'``.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from attrs import frozen

from afm_scan_bench.any_lab.diagnoses import HEALTHY, calibrated, drawn, with_effect
from afm_scan_bench.any_lab.effects import EVERY
from afm_scan_bench.any_lab.outcomes import names_of
from afm_scan_ros.api.diagnosis import observation_of
from afm_scan_ros.core.diagnosis.healthy import with_healthy
from afm_scan_ros.core.diagnosis.preparation import evidence_of
from afm_scan_ros.core.diagnosis.records import Observation
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scanner import chain_of
from afm_scan_ros.core.types import Array
from afm_scan_ros.report.table import Row, Table

SEEDS = range(10)
DEGREE, TERMS = 3, 10
"""Of the polynomials, and the most terms that are tried."""
THRESHOLDS = (0.5, 0.2, 0.1, 0.05, 0.02, 0.01)
POSITION, SPEED, TIME, SIDE = range(4)
EFFECTS: Mapping[tuple[int, ...], set[str]] = {
    (POSITION,): {"parameter_shift"},
    (POSITION, POSITION): {"static_nonlinearity"},
    (POSITION, POSITION, POSITION): {"static_nonlinearity"},
    (SPEED,): {"delay", "input_lag"},
    (TIME,): {"drift", "slow_creep"},
    (TIME, TIME): {"drift", "slow_creep"},
    (SIDE,): {"backlash"},
}
"""Effects that a product of signals stands for; either name counts as right."""

COLUMNS = {
    "method": ("method", ""),
    "false": ("something in a healthy scan", "d"),
    "healthy": ("of", "d"),
    "found": ("something in one with an effect", "d"),
    "right": ("right effect", "d"),
    "effects": ("of", "d"),
}


@frozen(eq=False)
class Case:
    """Signals (n, 4) and residual (n,) of a record, each of unit rms, and the true effects."""

    signals: Array
    residual: Array
    truth: set[str]


Method = Callable[[Array, Array], tuple[int, ...]]


def measure() -> Table:
    """Count what each method finds."""
    cases = [case for seed in SEEDS for case in _cases(seed)]
    rows = [_row(name, cases, [_named(method, one) for one in cases]) for name, method in METHODS]
    return Table("rivals", "Terms found in residuals of drawn scanners", COLUMNS, rows)


def _row(method: str, cases: Sequence[Case], found: Sequence[set[str]]) -> Row:
    pairs = list(zip(cases, found, strict=True))
    healthy = [names for one, names in pairs if not one.truth]
    sick = [(one, names) for one, names in pairs if one.truth]
    return {
        "method": method,
        "false": sum(map(bool, healthy)),
        "healthy": len(healthy),
        "found": sum(bool(names) for _, names in sick),
        "right": sum(bool(one.truth & names) for one, names in sick),
        "effects": len(sick),
    }


def _named(method: Method, one: Case) -> set[str]:
    """Effects that the largest term stands for; "none of these" where it is another."""
    term = method(one.signals, one.residual)
    return EFFECTS.get(term, {"none of these"}) if term else set()


def stlsq(signals: Array, residual: Array) -> tuple[int, ...]:
    """Largest term of pysindy's STLSQ, its threshold chosen by the score on the second half."""
    import pysindy as ps  # noqa: PLC0415 - an extra

    half, target = len(signals) // 2, residual[:, np.newaxis]
    best: tuple[int, ...] = ()
    score = 0.0
    for threshold in THRESHOLDS:
        library = ps.PolynomialLibrary(degree=DEGREE, include_bias=False)
        model = ps.SINDy(optimizer=ps.STLSQ(threshold=threshold), feature_library=library)
        model.fit(signals[:half], t=1.0, x_dot=target[:half])
        reached = model.score(signals[half:], t=1.0, x_dot=target[half:])
        if reached > score:
            powers = library.powers_[np.abs(model.coefficients()[0]).argmax()]
            best, score = _term(powers), float(reached)
    return best


def frols(signals: Array, residual: Array) -> tuple[int, ...]:
    """First term of SysIdentPy's FROLS, where Bayes's criterion prefers it to none."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415 - an extra
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415 - an extra
    from sysidentpy.parameter_estimation import LeastSquares  # noqa: PLC0415 - an extra

    model = FROLS(
        order_selection=True,
        n_info_values=TERMS,
        info_criteria="bic",
        ylag=1,
        xlag=[[1]] * signals.shape[1],
        model_type="NFIR",
        basis_function=Polynomial(degree=DEGREE),
        estimator=LeastSquares(),
    )
    model.fit(X=signals[1:], y=residual[:-1, np.newaxis])
    without = (len(residual) - 1) * np.log(np.var(residual))
    codes = [int(code) // 1000 - 2 for code in model.final_model[0] if code]
    return tuple(sorted(codes)) if np.nanmin(model.info_values) < without else ()


METHODS: tuple[tuple[str, Method], ...] = (("pysindy STLSQ", stlsq), ("SysIdentPy FROLS", frols))


def _term(powers: Array) -> tuple[int, ...]:
    return tuple(np.repeat(np.arange(len(powers)), powers).tolist())


def _cases(seed: int) -> Iterator[Case]:
    try:
        laboratory = calibrated(*drawn(seed))
        model = with_healthy(
            laboratory.model.scanner, [observation_of(r) for r in laboratory.known]
        )
        drives = [laboratory.scan() for _ in range(HEALTHY)]
        healthy = [observation_of(laboratory.healthy_record(drive)) for drive in drives]
        limit = evidence_of("x", model, healthy[0]).limit.total
        truth, _, record = with_effect(laboratory, seed, drives[0], limit)
    except (InputError, ScanError):
        return
    yield from (_case(model, observed, set()) for observed in healthy)
    yield _case(model, observation_of(record), {EVERY[name].name for name in names_of(truth)})


def _case(model: ScannerModel, observed: Observation, truth: set[str]) -> Case:
    """Signals and residual of a record."""
    evidence, chain = evidence_of("x", model, observed), chain_of(model.axis("x"))
    moved = evidence.playback.displacement(chain)
    speed = np.gradient(moved)
    signals = np.column_stack([moved, speed, np.arange(len(moved)), np.sign(speed)])
    signals = (signals - signals.mean(axis=0)) / signals.std(axis=0)
    residual = evidence.residual(chain)
    return Case(signals, residual / residual.std(), truth)
