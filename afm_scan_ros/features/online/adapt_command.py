"""``afm-scan adapt``: what a recorded scan shows to have changed, accepted into the model."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import click
from attrs import evolve

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli import options
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.features.online.adaptation import (
    CREEP_NAME,
    TIME_CONSTANT,
    Adaptation,
    AxisState,
    Outcome,
)
from afm_scan_ros.features.online.adapted_reference import AxisShift, with_shift
from afm_scan_ros.files import model_file
from afm_scan_ros.report.table import Rows, show
from afm_scan_ros.report.terminal import say

ADAPTED = ("axis", "parameter", "value", "unchanged", "outcome", "detection limit")
NAMES = {
    "gain": "factor on the gain",
    "frequency": "factor on the first resonance's frequency",
    "loss": "factor on its damping ratio, over that on the frequency",
    CREEP_NAME: "gain of slow creep beyond the model's",
}
OUTCOMES = {
    Outcome.UNCHANGED: "within the detection limit",
    Outcome.CHANGED: "changed",
    Outcome.NOT_EXCITED: "not excited by this scan",
    Outcome.BEYOND_BOUNDS: "beyond its bounds: identify the scanner anew",
    Outcome.OTHER_CAUSE: "not distinguished from another change: diagnose this scan",
}
PER_UNKNOWN = {"frequency": 0.5}
"""Change of a value per change of its unknown, near 1; 1 where it is left out: a = 1/f² - 1."""
HEADING = "A scanner's model with the changes that 'afm-scan adapt' found in {bag}."


@click.command()
@click.argument("bag", type=options.RECORD)
@click.option("--model", required=True, type=options.FILE, help="Model file of the scanner.")
@click.option(
    "--out", required=True, type=options.NEW_FILE, help="Model file to write, with the changes."
)
@click.option(
    "--time-constant",
    type=options.positive("s"),
    default=f"{TIME_CONSTANT:g}s",
    show_default=True,
    help="Memory of the estimator.",
)
@options.topic_option
def adapt(
    bag: Path, model: Path, out: Path, time_constant: float, topics: Mapping[str, str]
) -> None:
    """Track what changed in the scanner during the scan in BAG, and accept it into the model.

    The model written holds the values at the end of the scan. Nothing is written where nothing has
    changed beyond the detection limit.
    """
    options.refuse_existing(out, out.with_suffix(".npz"), other="file")
    base, recording = model_file.load_model(model), read_scan(bag, topics)
    options.warn(recording.warnings)
    if recording.info.spec is None:
        raise InputError(
            f"{bag}: adaptation compares lines, but scan_info states none: give the bag of a scan"
        )
    spec = recording.info.spec
    if (lasts := spec.lines / spec.line_rate) <= time_constant:
        raise InputError(
            f"--time-constant: {time_constant:g} s is not shorter than the lines of {bag},"
            f" {lasts:.3g} s: give a shorter one, or a longer scan"
        )
    adaptation = Adaptation(base, spec, time_constant)
    for drive, measured in recording.blocks("drive_voltage", "achieved_displacement"):
        for _ in adaptation.add(drive, measured):
            pass
    rows = [row for name, state in adaptation.states.items() for row in _rows(name, state)]
    show([Rows(ADAPTED, rows)])
    shifts = {name: state.shift for name, state in adaptation.states.items()}
    if all(shift == AxisShift() for shift in shifts.values()):
        raise ScanError(f"{bag}: nothing has changed beyond the detection limit: no model written")
    changed = {name: with_shift(base.axis(name), shift) for name, shift in shifts.items()}
    model_file.save_model(out, evolve(base, **changed), HEADING.format(bag=bag.name))
    say(f"Model: {out}.")


def _rows(axis: str, state: AxisState) -> Iterator[tuple[str, ...]]:
    for name, finding in state.findings.items():
        value, unchanged = (getattr(shift, name) for shift in (state.shift, AxisShift()))
        dead_zone = PER_UNKNOWN.get(name, 1.0) * finding.dead_zone
        limit = "" if finding.outcome is Outcome.NOT_EXCITED else f"{dead_zone:.2g}"
        yield axis, NAMES[name], f"{value:.4f}", f"{unchanged:g}", OUTCOMES[finding.outcome], limit
