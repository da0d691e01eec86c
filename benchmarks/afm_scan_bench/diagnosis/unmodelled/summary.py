"""Summary of all cases."""

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from afm_scan_bench.accuracy.coverage import clopper_pearson
from afm_scan_bench.diagnosis.unmodelled.judge import CLEAR, CORRECT, MISLEADING, RESOLVED, WRONG
from afm_scan_bench.diagnosis.unmodelled.runs import UnmodelledOutcome
from afm_scan_ros.core.effects.registry import effect_type

RESIDUAL, TRACKING, WORST = 1.2, 1.3, 1.05
"""Largest ratios within tolerance: residual, tracking, and error of other scans."""


def summary(found: Sequence[UnmodelledOutcome]) -> str:
    """Sentences, one a line; plants' seeds first."""
    seeds = [outcome.case.plant for outcome in found]
    lines = [
        f"Diagnosis of scanners drawn by seeds {min(seeds)} to {max(seeds)}",
        *_names(found),
        *_extension(found),
        _durations([outcome.seconds for outcome in found]),
    ]
    return "\n".join(lines)


def _durations(seconds: Sequence[float]) -> str:
    return f"time: median {np.median(seconds):.0f} s, longest {max(seconds):.0f} s"


def share(
    text: str, outcomes: Sequence[UnmodelledOutcome], true: Callable[[UnmodelledOutcome], bool]
) -> Iterator[str]:
    """Say of how many something is true, with its 95 % bounds; nothing where there are none."""
    if outcomes:
        yield counted(text, sum(true(o) for o in outcomes), len(outcomes))


def counted(text: str, count: int, of: int) -> str:
    """Say how many of how many, in percent, with the 95 % bounds of Clopper and Pearson."""
    if not of:
        return f"{text}: no case"
    low, high = (100.0 * bound for bound in clopper_pearson(count, of))
    return f"{text}: {count} of {of}, {100.0 * count / of:.1f} % ({low:.1f} to {high:.1f} %)"


def _names(found: Sequence[UnmodelledOutcome]) -> Iterator[str]:
    inside = [o for o in found if None not in o.case.truth]
    single = [o for o in inside if len(o.case.effects) == 1]
    clear = [o for o in single if o.size and o.size.ratio >= CLEAR]
    faint = [o for o in single if o.size and o.size.ratio < CLEAR]
    yield from share(f"correct or resolved, ratio from {CLEAR:g} on", clear, _named)
    yield from share(f"correct or resolved, ratio below {CLEAR:g}", faint, _named)
    named = [o.size.added for o in single if o.size and _named(o)]
    if named:
        yield f"smallest effect named: {1e9 * min(named):.0f} nm rms"
    yield from share("both of a pair named", [o for o in inside if o not in single], _named)
    yield from share("wrong", inside, lambda o: o.answer == WRONG)
    yield from share("misleading", inside, lambda o: o.answer == MISLEADING)
    outside = [o for o in found if None in o.case.truth]
    yield from share(
        "outside the catalogue, yet named", outside, lambda o: o.answer in (WRONG, MISLEADING)
    )


def _extension(found: Sequence[UnmodelledOutcome]) -> Iterator[str]:
    """Errors with the extended models, on the scans that their inverses can make."""
    done = [(o, o.repeated) for o in found if o.repeated]
    residual = [r.residual for _, r in done]
    yield from _within(f"residual at most {RESIDUAL:g}", residual, RESIDUAL)
    yield from _within(
        f"tracking at most {TRACKING:g}, where feedforward can help",
        [r.tracking for o, r in done if _feedforward(o)],
        TRACKING,
    )
    worst = [r.worst for _, r in done]
    yield from _within(f"worst at most {WORST:g}", worst, WORST)
    if done:
        refused = sum(bool(r.refused) for _, r in done)
        yield counted("a scan refused", refused, len(done))
    parameters = [p for o in found for p in o.parameters]
    if parameters:
        inside = sum(p.inside for p in parameters)
        yield counted("parameters inside their 95 % interval", inside, len(parameters))


def _within(text: str, values: Sequence[float], most: float) -> Iterator[str]:
    """Say how many of those values that there are come to no more than ``most``."""
    known = [value for value in values if not math.isnan(value)]
    if known:
        yield counted(text, sum(value <= most for value in known), len(known))


def _named(outcome: UnmodelledOutcome) -> bool:
    return outcome.answer in (CORRECT, RESOLVED)


def _feedforward(outcome: UnmodelledOutcome) -> bool:
    return all(effect_type(name).remedy == "feedforward" for name in outcome.case.truth if name)
