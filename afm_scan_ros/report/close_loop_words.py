"""A closed loop in words and rows of text, for the terminal and for the report alike."""

from collections.abc import Iterator, Sequence

from afm_scan_ros.core.closed_loop.comparison import ScanComparison
from afm_scan_ros.core.closed_loop.loop import Round
from afm_scan_ros.core.closed_loop.test_scans import FIRST
from afm_scan_ros.core.metrics import Figure, Tracking
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.diagnosis_words import conclusions
from afm_scan_ros.report.tables import nanometres

Row = tuple[str, ...]

TRACKING = ("error, nm:\nbefore → after", "", "measured", "true", "constant\nspeed", "turning")
"""Constant speed and turning: of the true error too. No wider than a terminal's 80 columns."""
RESIDUAL = ("residual on unseen scans, nm", "", "floor", "model", "extended model")
REPLAYED = (
    "The simulated drift begins anew with each scan, and so does its inverse, which takes all of it"
    " away. A real drift does not restart: what is removed of one is as good as it repeats."
)


def trial_title(name: str, spec: ScanSpec, axis: str) -> str:
    """Say what a trial is: its name in the row of x, below it as ``raster, 10 Hz, 40 µm``."""
    if axis == "x":
        return f"{name}:"
    return f"{spec.pattern}, {spec.line_rate:.4g} Hz, {1e6 * spec.range_x:.4g} µm"


def tracking_rows(done: Round) -> list[Row]:
    """Return a row for each trial and axis: its errors before and after."""
    return [
        (
            trial_title(name, done.before[name].spec, axis),
            axis,
            _change(trial.measured_before, trial.measured_after, axis, "all"),
            *(
                _change(trial.true_before, trial.true_after, axis, part)
                for part in ("all", "constant_speed", "turnarounds")
            ),
        )
        for name, trial in done.comparisons.items()
        for axis in AXES
    ]


def trial_residual_rows(done: Round) -> list[Row]:
    """Return a row for each trial and axis: what model and extended model leave of it."""
    return [
        (
            trial_title(name, done.before[name].spec, axis),
            axis,
            *(nanometres(v) for v in (left.floor, left.before, left.after)),
        )
        for name, trial in done.comparisons.items()
        for axis, left in trial.residual.items()
    ]


def outcome(done: Round) -> Iterator[str]:
    """Yield what a round found and brought, in sentences."""
    yield from conclusions(done.diagnosis)
    if done.experiments:
        yield f"Experiments recorded to settle it: {', '.join(done.experiments)}."
    if done.diagnosis.effects and not done.comparisons and not done.refusal:
        yield "Nothing is found that the model does not have by now."
    if done.refusal:
        yield f"The extended inverse cannot make these scans: {done.refusal}."
    for (name, axis), ratio in done.worse.items():
        yield (
            f"With the extended inverse '{name}' is followed worse in {axis}: {ratio:.2f} times the"
            " error. The model is not replaced."
        )
    if done.comparisons and any(effect.name == "drift" for effect in done.diagnosis.effects):
        yield REPLAYED
    own = sorted({e.name for e in done.diagnosis.effects if any(v.parameter.own for v in e.values)})
    if own and done.comparisons:
        yield (
            f"Of {' and '.join(own)} a part is another in every record, and cannot be foreseen: in"
            " the residual of the unseen scans it is told from these themselves."
        )
    if done.kept:
        yield _gain(done.comparisons[FIRST])
        if not done.improved:
            yield "That is no gain in tracking, so no further round is made."


def final_words(rounds: Sequence[Round], failure: str = "") -> Iterator[str]:
    """Yield how the loop ended, in sentences; ``failure`` is what ended the next round, if any."""
    if failure:
        yield f"Round {len(rounds) + 1} failed, and what follows is of those before: {failure}."
    kept = [done for done in rounds if done.improved]
    if not kept:
        yield "No extension made the scanner follow better."
        return
    first, last = kept[0].comparisons[FIRST], kept[-1].comparisons[FIRST]
    for axis in AXES:
        change = _change(first.measured_before, last.measured_after, axis, "all")
        yield f"Tracking error in {axis}, measured, rms: {change} nm."


def _gain(trial: ScanComparison) -> str:
    figures = ", ".join(f"{ratio:.2f} in {axis}" for axis, ratio in trial.change.items())
    return f"Measured error of the same scan, after over before: {figures}."


def _change(before: Tracking, after: Tracking, axis: str, part: str) -> str:
    figures: list[Figure | None] = [getattr(getattr(t, axis), part) for t in (before, after)]
    return " → ".join("-" if f is None else nanometres(f.rms) for f in figures)
