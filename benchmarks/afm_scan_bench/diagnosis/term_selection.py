"""Sparse regression of a residual on products of signals, by pysindy and by SysIdentPy.

Needs ``pip install './benchmarks[rivals]'``.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

SIGNALS = ("position", "speed", "acceleration", "side", "time")
"""Position is the predicted displacement; side is the sign of the speed.

The drive is left out: it is nearly proportional to position, and STLSQ cancels one with the other.
"""
TERMS = tuple(
    names
    for degree in (1, 2)
    for names in combinations_with_replacement(SIGNALS, degree)
    if names != ("side", "side")
)
"""Products of one or two signals, the default degree of both libraries; side² is constant."""

EFFECTS: Mapping[tuple[str, ...], set[str]] = {
    ("position",): {"parameter_shift"},
    ("position", "position"): {"static_nonlinearity"},
    ("speed",): {"delay", "input_lag", "slew_limit"},
    ("acceleration",): {"parameter_shift", "extra_resonance"},
    ("side",): {"backlash"},
    ("time",): {"drift", "slow_creep"},
    ("time", "time"): {"drift", "slow_creep"},
}
"""Effects that a dominant term stands for to first order: any of them counts."""

THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.5)
"""Of STLSQ, over the residual's rms."""
COUNTS = (1, 2, 4, 8)
"""Terms that forward regression may select."""

Method = Callable[[Array, Array], int | None]
"""Index of the dominant column of terms (n, k) in a residual (n,), each of unit rms, or None."""


def effects_of(term: int | None) -> set[str]:
    """Effects that a dominant term stands for: none, some, or "outside" for any other product."""
    return set() if term is None else EFFECTS.get(TERMS[term], {"outside"})


def terms_of(position: Array) -> Array:
    """Terms (n, k) of a displacement (n,), without mean and of unit rms."""
    speed = np.gradient(position)
    time = np.arange(len(position), dtype=float)
    signals = (position, speed, np.gradient(speed), np.sign(speed), time)
    named = dict(zip(SIGNALS, map(scaled, signals), strict=True))
    products = (np.prod([named[name] for name in names], axis=0) for names in TERMS)
    return np.column_stack([scaled(one) for one in products])


def scaled(signal: Array) -> Array:
    """Signal (n,) without its mean, of unit rms."""
    centred = signal - signal.mean()
    return np.asarray(centred / np.std(centred))


def stlsq(terms: Array, residual: Array) -> int | None:
    """Largest coefficient of pysindy's STLSQ, with the threshold that predicts best."""
    from pysindy import STLSQ  # noqa: PLC0415 - an extra

    best = _best([STLSQ(threshold=each) for each in THRESHOLDS], terms, residual)
    return None if best is None else int(np.abs(best.coef_[0]).argmax())


def pysindy_frols(terms: Array, residual: Array) -> int | None:
    """First term of pysindy's FROLS, with the number of terms that predicts best."""
    from pysindy import FROLS  # noqa: PLC0415 - an extra

    best = _best([FROLS(max_iter=each) for each in COUNTS], terms, residual)
    return None if best is None else int(np.abs(best.history_[1][0]).argmax())


def _best(models: Sequence[Any], terms: Array, residual: Array) -> Any:  # noqa: ANN401 - no types
    """Model that predicts fifths of the record from the others best, or None where none does."""
    from sklearn.model_selection import KFold, cross_val_score  # noqa: PLC0415

    target = residual[:, np.newaxis]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a threshold that leaves no term
        scores = [cross_val_score(m, terms, target, cv=KFold()).mean() for m in models]
    best = int(np.argmax(scores))
    return models[best].fit(terms, target) if scores[best] > 0.0 else None


def sysidentpy_frols(terms: Array, residual: Array) -> int | None:
    """First term of SysIdentPy's FROLS, where Bayes's criterion prefers a term to none."""
    from sysidentpy.basis_function import Polynomial  # noqa: PLC0415 - an extra
    from sysidentpy.model_structure_selection import FROLS  # noqa: PLC0415
    from sysidentpy.parameter_estimation import LeastSquares  # noqa: PLC0415

    model = FROLS(
        order_selection=True,
        n_info_values=COUNTS[-1],
        info_criteria="bic",
        xlag=[[1]] * terms.shape[1],
        ylag=1,
        model_type="NFIR",
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(),
    )
    model.fit(X=terms[1:], y=residual[:-1, np.newaxis])  # a lag of 1 is the least there is
    nothing = (len(residual) - 2) * np.log(np.var(residual))
    return int(model.final_model[0, 0]) // 1000 - 2 if np.min(model.info_values) < nothing else None


METHODS: Mapping[str, Method] = {
    "pysindy STLSQ": stlsq,
    "pysindy FROLS": pysindy_frols,
    "SysIdentPy FROLS": sysidentpy_frols,
}


def require_libraries() -> None:
    """Raise InputError where pysindy or SysIdentPy is missing."""
    try:
        import pysindy  # noqa: F401, PLC0415 - an extra
        import sysidentpy  # noqa: F401, PLC0415
    except ImportError as error:
        raise InputError(f"{error}: pip install './benchmarks[rivals]'") from error
