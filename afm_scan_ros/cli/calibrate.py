"""``afm-scan calibrate``: records for the identification, or one experiment."""

from collections.abc import Sequence
from pathlib import Path

import click

from afm_scan_ros.cli import driving
from afm_scan_ros.cli.options import FILE, FOLDER, grouped, positive
from afm_scan_ros.cli.plan import PlanOptions, export, plan_options
from afm_scan_ros.cli.scanner import SIM
from afm_scan_ros.core.identification.drives.excitation import PLANS, Plan
from afm_scan_ros.core.identification.drives.experiments import (
    EXPERIMENTS,
    KINDS,
    SWEEPS,
    peak,
    resampled,
    resized,
)
from afm_scan_ros.core.identification.drives.growth import MotionLimits
from afm_scan_ros.core.identification.drives.proposal import combined, known_from
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import load_model

Size = tuple[float | None, float | None]
"""Amplitude (V) and duration (s) of a drive; its own where they are None."""
OWN_SIZE: Size = None, None


def _drive(kind: str, model: ScannerModel | None, size: Size, rate: float | None) -> Plan:
    """Drive of a kind, for the scanner of a model, if there is one."""
    if model is not None and kind in EXPERIMENTS:
        plan = EXPERIMENTS[kind].plan_for(model, *size)
    else:
        plan = resized(KINDS[kind](), *size)
    return plan if rate is None else resampled(plan, rate)


def _next(out: Path, experiment: str | None) -> str:
    """The command that a record is for."""
    if experiment is None:
        bags = " ".join(f"--{kind} {out / kind}" for kind in PLANS)
        return f"afm-scan identify {bags} --out model.yaml"
    bag = out / experiment
    if experiment in SWEEPS:
        return f"afm-scan identify --frequency {bag}, with the other calibration records"
    command = f"afm-scan diagnose BAG... {bag} --model model.yaml --out diagnosis_{experiment}"
    return f"diagnose it together with the bags of the ambiguous diagnosis: {command}"


def _experiment(
    experiment: str | None, amplitude: float | None, duration: float | None
) -> tuple[str | None, Size]:
    size = amplitude, duration
    if experiment is None and size != OWN_SIZE:
        raise click.UsageError("--amplitude and --duration size an --experiment: give it too")
    return experiment, size


experiment_options = grouped(
    "experiment",
    _experiment,
    click.option(
        "--experiment", type=click.Choice(tuple(EXPERIMENTS)), help="Record only this experiment."
    ),
    click.option(
        "--amplitude",
        type=positive("V"),
        help="With --experiment: its largest voltage, from the middle of the drive.",
    ),
    click.option(
        "--duration",
        type=positive("s"),
        help="With --experiment: its length. All times change in proportion.",
    ),
)


PURPOSES = (f"  {name}: {experiment.purpose}" for name, experiment in EXPERIMENTS.items())


@click.command(epilog="\n\n".join(("Experiments:", *PURPOSES)))
@driving.driven_options
@click.option(
    "--out",
    type=FOLDER,
    help="Folder for the bags: of each record, and of the smaller drives before it.",
)
@click.option(
    "--export",
    "folder",
    type=FOLDER,
    help="Drive nothing: write the drives to this folder as CSV and npz, for a lab's converter.",
)
@click.option(
    "--model",
    type=FILE,
    help="Scale the drives to the scanner of this model: its range, voltages and resonance.",
)
@plan_options
@click.option(
    "--travel",
    type=positive("m"),
    help="Largest displacement from peak to peak.  [default: 1.4 times the range]",
)
@click.option(
    "--excitation",
    type=positive("m"),
    help="Largest peak of the resonance beyond the steady displacement.  [default: half the range]",
)
@experiment_options
def calibrate(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    driven: driving.DrivenScanner,
    out: Path | None,
    experiment: tuple[str | None, Size],
    folder: Path | None,
    model: Path | None,
    wanted: PlanOptions,
    travel: float | None,
    excitation: float | None,
) -> None:
    """Drive the scanner with steps, multisines, loops and random moves, and record each.

    With --range or --model, the drives are those of 'afm-scan plan' for this scanner. Each begins
    at a sixteenth of its voltage, and grows while the response stays within --travel and
    --excitation. Without both, the drives are those for the default simulated scanner.

    With --experiment, use a drive that distinguishes effects which a scan cannot.
    """
    name, size = experiment
    known = load_model(model) if model else None
    if folder is not None:
        _export(folder, name, known, size, wanted)
        return
    if out is None:
        raise click.UsageError("give a folder for the bags with --out, or one with --export")
    if name is None and (known or wanted.scan_range):
        limits = driven.limits
        scan_range = wanted.range_for(known)
        motion = MotionLimits.of_range(scan_range, travel, excitation)
        converter = wanted.converter_for(known, limits)
        have = combined([wanted.covered, *([known_from(known)] if known else [])])
        planned = driving.PlannedCalibration(
            driven, out, converter, limits, motion, scan_range, wanted.hold, have
        )
        advice = _identified([*wanted.have, *planned.run()])
    else:
        plans = _default_drives(driven.scanner, name, known, size, wanted.rate)
        driving.run_calibration(driven, out, plans)
        advice = _next(out, name)
    of = driven.scanner
    recorded = f"the simulated scanner of {driven.plant}" if of == SIM else f"scanner {of}"
    click.echo(f"Recorded {recorded} in {out}.")
    click.echo(f"next: {advice}")


def _identified(bags: Sequence[Path]) -> str:
    """Return the command that identifies a model from records; that of validation is held out."""
    words = (f"--validation {bag}" if bag.name == "validation" else str(bag) for bag in bags)
    return f"afm-scan identify {' '.join(words)} --out model.yaml"


def _export(
    folder: Path,
    name: str | None,
    model: ScannerModel | None,
    size: Size,
    wanted: PlanOptions,
) -> None:
    if name is None and (model or wanted.rate):
        raise click.UsageError(
            "--model and --rate change what --experiment and --export write: give both;"
            " 'afm-scan plan --export' writes the drives of a calibration"
        )
    plans = [_drive(kind, model, size, wanted.rate) for kind in ([name] if name else PLANS)]
    export(folder, plans, model.axes if model else AXES)


def _default_drives(
    scanner: str, name: str | None, model: ScannerModel | None, size: Size, rate: float | None
) -> list[Plan]:
    """Drives of the library; raises UsageError where these would not fit a scanner."""
    if name is None:
        if scanner != SIM:
            raise click.UsageError(
                f"--scanner {scanner}: the default drives fit the default simulated scanner alone:"
                " give --range, --limit and --rate, or --model and --rate"
            )
        if rate is not None:
            raise click.UsageError("--rate is that of planned drives: give --range too")
        return [plan() for plan in PLANS.values()]
    plan = _drive(name, model, size, rate)
    if scanner != SIM and model is None and None in size and peak(plan) > 0.0:
        raise click.UsageError(
            f"--scanner {scanner}: the drive of {name} is for the default simulated scanner: give"
            " --model, or --amplitude and --duration"
        )
    return [plan]
