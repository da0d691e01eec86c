"""Counts of drawn diagnoses: what was named, and how often a stated probability was right."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.accuracy.coverage import clopper_pearson
from afm_scan_bench.any_lab.effects import EVERY
from afm_scan_bench.any_lab.outcomes import RESULTS, DiagnosisOutcome, names_of
from afm_scan_bench.diagnosis.unmodelled.summary import counted
from afm_scan_ros.report.paper import blank, styled
from afm_scan_ros.report.picture import BLUE, GREY, ORANGE
from afm_scan_ros.report.table import Row, Table

CLEAR, AGAIN = 3.0, 1.2
"""Times the detection limit from which an effect is to be named, and times the healthy residual to
which its name is to lower it."""
BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 0.95, 1.0)
SIZES = (0.0, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)
"""Edges of the bins of effect over detection limit."""
COLUMNS = {
    "effect": ("effect", ""),
    "cases": ("cases", "d"),
    "clear": ("from 3 limits on", "d"),
    **{name: (text, "d") for name, text in RESULTS.items()},
    "seconds": ("CPU s, median", ".0f"),
}


def table(outcomes: Sequence[DiagnosisOutcome]) -> Table:
    """Count by effect, with a summary in the title and the reliability as a picture."""
    done = [o for o in outcomes if o.said]
    single = {name: [o for o in done if o.effect == name] for name in EVERY}
    groups = {**single, "two effects": [o for o in done if " + " in o.effect], "all": done}
    rows = [_row(name, some) for name, some in groups.items() if some]
    title = "\n".join(_title(outcomes, done))
    return Table("diagnosis", title, COLUMNS, rows, picture=lambda: reliability(done))


def _row(effect: str, outcomes: Sequence[DiagnosisOutcome]) -> Row:
    results = [o.result for o in outcomes if o.times >= CLEAR]
    counts = {name: results.count(name) for name in RESULTS}
    counts["wrong"] = sum(o.result == "wrong" for o in outcomes)
    seconds = float(np.median([o.said.seconds for o in outcomes if o.said]))
    sizes = {"cases": len(outcomes), "clear": len(results)}
    return {"effect": effect, **sizes, **counts, "seconds": seconds}


def _title(outcomes: Sequence[DiagnosisOutcome], done: Sequence[DiagnosisOutcome]) -> Iterator[str]:
    yield "Diagnoses of scanners and records drawn at random"
    yield counted("refused", len(outcomes) - len(done), len(outcomes))
    healthy = [said for o in done for said in o.healthy]
    for verdict in ("effect_found", "ambiguous", "unexplained"):
        found = sum(said.verdict == verdict for said in healthy)
        yield counted(f"a healthy scan called {verdict}", found, len(healthy))
    yield counted("a wrong name with confidence", sum(o.result == "wrong" for o in done), len(done))
    floors = [said.limit / said.before for said in healthy]
    yield f"detection limit over what healthy scans leave: median {np.median(floors):.2f}"
    yield from _named(done)
    yield from _coverage(done)
    for mean, right, of in _reliability(done):
        yield counted(f"there, at a mean probability of {mean:.2f}", right, of)


def _named(done: Sequence[DiagnosisOutcome]) -> Iterator[str]:
    """Named or credible from 3 limits on, by kind; residual with the name over the healthy one."""
    clear = [o for o in done if o.times >= CLEAR]
    pairs = [o for o in clear if " + " in o.effect]
    unknown = [o for o in clear if o.truth == {"outside"}]
    single = [o for o in clear if o not in pairs and o not in unknown]
    for text, some in (("single effect", single), ("pair", pairs)):
        yield counted(f"{text} from 3 limits on, named or credible", _right(some), len(some))
    left = sum(o.result in ("unexplained", "credible") for o in unknown)
    yield counted("outside the catalogue, from 3 limits on, unexplained", left, len(unknown))
    after = [o.said.after / o.healthy[0].before for o in done if o.said and o.result == "named"]
    yield counted(
        "named, residual after at most 1.2 of healthy", sum(np.array(after) <= AGAIN), len(after)
    )


def _right(outcomes: Sequence[DiagnosisOutcome]) -> int:
    return sum(o.result in ("named", "credible") for o in outcomes)


def _coverage(done: Sequence[DiagnosisOutcome]) -> Iterator[str]:
    sets = [(o, o.said.credible(0.9)) for o in done if o.said and o.times >= CLEAR]
    covered = sum(o.truth in credible for o, credible in sets)
    yield counted("from 3 limits on, the truth in the 90 % credible set", covered, len(sets))
    if sets:
        yield f"sets in it: mean {np.mean([len(credible) for _, credible in sets]):.2f}"


def _reliability(done: Sequence[DiagnosisOutcome]) -> Iterator[tuple[float, int, int]]:
    """Mean stated probability of effects, how many were there, and of how many; bin by bin."""
    pairs = [(p, n in o.truth) for o in done for n, p in _stated(o)]
    for low, high in pairwise(BINS):
        inside = [(p, there) for p, there in pairs if low < p <= high]
        if inside:
            yield float(np.mean([p for p, _ in inside])), sum(t for _, t in inside), len(inside)


def _stated(outcome: DiagnosisOutcome) -> Iterator[tuple[str, float]]:
    said = outcome.said
    names = {n for names in said.probabilities for n in names_of(names)} if said else set()
    for name in sorted(names):
        yield name, said.of_effect(name) if said else 0.0


@styled
def reliability(done: Sequence[DiagnosisOutcome]) -> Figure:
    """Stated probability against the share that was there, and the share right by size."""
    figure = blank(8.0, 3.6)
    left, right = figure.subplots(1, 2)
    left.plot([0.0, 1.0], [0.0, 1.0], color=GREY, zorder=0, label="stated = there")
    for mean, there, of in _reliability(done):
        low, high = clopper_pearson(there, of)
        left.plot([mean, mean], [low, high], color=BLUE)
        left.plot(mean, there / of, "o", color=BLUE, ms=4)
        left.annotate(f"of {of}", (mean, there / of), (5, -3), textcoords="offset points")
    left.set(xlabel="stated probability of an effect", ylabel="share of cases with this effect")
    left.set_title("reliability, with 95 % intervals")
    left.legend(loc="upper left")
    single = [o for o in done if " + " not in o.effect and o.truth != {"outside"}]
    for result, colour in (("named", BLUE), ("credible", ORANGE)):
        _by_size(right, single, result, colour)
    right.axvline(CLEAR, color=GREY, zorder=0)
    right.set(xscale="log", xlabel="effect over detection limit (rms)", ylim=(-3.0, 103.0))
    right.set_title("single effects, % of cases")
    right.legend(loc="center left")
    return figure


def _by_size(panel: Axes, single: Sequence[DiagnosisOutcome], result: str, colour: str) -> None:
    """Share of cases of a result in each bin of size, at the median size."""
    marks = []
    for low, high in pairwise(SIZES):
        some = [o for o in single if low < o.times <= high]
        if some:
            share = 100.0 * sum(o.result == result for o in some) / len(some)
            marks.append((float(np.median([o.times for o in some])), share))
    panel.plot(*zip(*marks, strict=True), "o-", color=colour, ms=4, label=result)
