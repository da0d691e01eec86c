"""``afm-scan adapt``: the model with what has changed in the scanner during a recorded scan."""

from collections.abc import Mapping
from pathlib import Path

import click
from attrs import evolve

from afm_scan_ros.bag.reader import read_scan
from afm_scan_ros.cli.options import FILE, RECORD, positive, refuse_existing, warn
from afm_scan_ros.cli.tables import topic_option
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.learning import TIME_CONSTANT
from afm_scan_ros.core.learning.adaptation import Adaptation
from afm_scan_ros.core.learning.adapted_reference import AxisShift, with_shift
from afm_scan_ros.files.model_file import load_model, save_model
from afm_scan_ros.report.scan_report import adaptation_rows
from afm_scan_ros.report.table import show

HEADING = "A scanner's model with the changes that 'afm-scan adapt' found in {bag}."


@click.command()
@click.argument("bag", type=RECORD)
@click.option("--model", required=True, type=FILE, help="Model file of the scanner.")
@click.option("--out", required=True, type=FILE, help="Model file to write, with the changes.")
@click.option(
    "--time-constant",
    type=positive("s"),
    default=f"{TIME_CONSTANT:g}s",
    show_default=True,
    help="Memory of the estimator.",
)
@topic_option
def adapt(
    bag: Path, model: Path, out: Path, time_constant: float, topics: Mapping[str, str]
) -> None:
    """Track what changed in the scanner during the scan in BAG, and accept it into the model.

    The model written holds the values at the end of the scan. Nothing is written where nothing has
    changed beyond the detection limit.
    """
    refuse_existing(out, out.with_suffix(".npz"), other="file")
    base, recording = load_model(model), read_scan(bag, topics)
    warn(recording.warnings)
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
    show([adaptation_rows(adaptation.states)])
    shifts = {name: state.shift for name, state in adaptation.states.items()}
    if all(shift == AxisShift() for shift in shifts.values()):
        raise ScanError(f"{bag}: nothing has changed beyond the detection limit: no model written")
    changed = {name: with_shift(base.axis(name), shift) for name, shift in shifts.items()}
    save_model(out, evolve(base, **changed), HEADING.format(bag=bag.name))
    click.echo(f"Model: {out}.")
