"""``afm-scan calibrate``: records for the identification, or one experiment."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click
from attrs import evolve

from afm_scan_ros.cli.options import FILE, FOLDER, positive, refuse_existing
from afm_scan_ros.cli.plan import export
from afm_scan_ros.cli.processes import NodeCommand, pace, run_nodes, set_aside
from afm_scan_ros.cli.progress import watching
from afm_scan_ros.cli.scanner import SIM, ScannerChoice, choose, pace_of, scanner_options
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.identification.drives.excitation import PLANS, Plan, excitation_block
from afm_scan_ros.core.identification.drives.experiments import (
    EXPERIMENTS,
    KINDS,
    SWEEPS,
    resampled,
    resized,
)
from afm_scan_ros.core.identification.drives.waypoints import Waveform
from afm_scan_ros.core.types import AXES
from afm_scan_ros.files.model_file import load_model

Size = tuple[float | None, float | None]
"""Amplitude (V) and duration (s) of a drive; its own where they are None."""
OWN_SIZE: Size = None, None


def run_calibration(
    plant: Path,
    out: Path,
    seed: int,
    time_scale: float | None = None,
    kinds: Iterable[str] = PLANS,
    size: Size = OWN_SIZE,
    scanner: str = SIM,
) -> None:
    """Record each of ``kinds``, as ``creep``, in a bag of its name in ``out``.

    Each has the ``size``, an amplitude (V) and a duration (s), or its own where they are None.
    The plant and the seed are those of the ``scanner`` sim.
    Raises InputError before the first begins, ScanError where one stays incomplete; all bags are
    then set aside.
    """
    if time_scale is None:
        time_scale = pace_of(scanner)
    bags = {kind: out / kind for kind in kinds}
    refuse_existing(*bags.values())
    out.mkdir(parents=True, exist_ok=True)
    try:
        for number, (kind, bag) in enumerate(bags.items(), 1):
            chosen = choose(scanner, plant)
            _refuse_beyond(chosen, kind, size)
            own = {"seed": seed} if scanner == SIM else {}
            with watching(f"{kind} record, {number} of {len(bags)}, to {bag}") as idle:
                commands = _commands(kind, bag, chosen, own, time_scale, size)
                run_nodes(commands, idle, [chosen.node])
    except (InputError, ScanError) as error:
        raise type(error)(f"{error}{set_aside(bags.values())}") from error
    except KeyboardInterrupt:
        set_aside(bags.values())
        raise


def _refuse_beyond(scanner: ScannerChoice, kind: str, size: Size) -> None:
    """Raise ScanError for a drive beyond the scanner's limits, before it moves."""
    if scanner.limits is not None:
        plan = resized(KINDS[kind](), *size)
        drive = excitation_block(plan, 0, plan.total_samples)
        scanner.limits.refuse_beyond(drive, dict.fromkeys(AXES, 0.0))


def _commands(
    kind: str,
    bag: Path,
    scanner: ScannerChoice,
    own: Mapping[str, object],
    time_scale: float,
    size: Size,
) -> list[NodeCommand]:
    paced = pace(time_scale)
    amplitude, duration = size
    drive = {
        "kind": kind,
        "amplitude_v": amplitude or 0.0,
        "duration_s": duration or 0.0,
        "required_nodes": [scanner.node, "scan_recorder"],
        **scanner.source,
    }
    return [
        NodeCommand("scan_recorder", {"bag": str(bag), "topics": scanner.topics, **paced}),
        *(evolve(c, parameters={**c.parameters, **own, **paced}) for c in scanner.commands),
        NodeCommand("excitation_generator", {**drive, "time_scale": time_scale, **paced}),
    ]


def _purposes() -> str:
    """Each experiment and what it is for, as click prints a list."""
    lines = (f"  {name}: {experiment.purpose}" for name, experiment in EXPERIMENTS.items())
    return "\n\n".join(("Experiments:", *lines))


def _drives(
    kinds: Sequence[str], model: Path | None, size: Size, rate: float | None
) -> tuple[list[Plan[Waveform]], Sequence[str]]:
    """Drives of these kinds, and the axes that they are of: those of the model, if there is one."""
    scanner = load_model(model) if model else None
    plans = [
        EXPERIMENTS[kind].plan_for(scanner, *size) if scanner else resized(KINDS[kind](), *size)
        for kind in kinds
    ]
    axes = scanner.axes if scanner else AXES
    return plans if rate is None else [resampled(plan, rate) for plan in plans], axes


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


def experiment_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add an experiment and its size to a command, which gets both as ``experiment``."""

    @click.option(
        "--experiment", type=click.Choice(tuple(EXPERIMENTS)), help="Record only this experiment."
    )
    @click.option(
        "--amplitude",
        type=positive("V"),
        help="With --experiment: its largest voltage, from the middle of the drive.",
    )
    @click.option(
        "--duration",
        type=positive("s"),
        help="With --experiment: its length. All times change in proportion.",
    )
    @wraps(command)
    def with_experiment(
        experiment: str | None,
        amplitude: float | None,
        duration: float | None,
        **options: Any,  # noqa: ANN401 - the command's own
    ) -> None:
        size = amplitude, duration
        if experiment is None and size != OWN_SIZE:
            raise click.UsageError("--amplitude and --duration size an --experiment: give it too")
        command(experiment=(experiment, size), **options)

    return with_experiment


@click.command(epilog=_purposes())
@scanner_options
@click.option(
    "--out",
    type=FOLDER,
    help="Folder for the bags creep, frequency, hysteresis and validation, or the experiment.",
)
@click.option(
    "--export",
    "folder",
    type=FOLDER,
    help="Drive nothing: write the drives to this folder as CSV and npz, for a lab's converter.",
)
@click.option("--seed", default=1, show_default=True, help="Seed of the sensor noise.")
@click.option(
    "--model",
    type=FILE,
    help="With --experiment and --export: scale the drive to the scanner of this model.",
)
@click.option(
    "--rate",
    type=positive("Hz"),
    help="With --experiment and --export: samples a second of the converter, where it cannot give"
    " those of the drive.",
)
@click.option(
    "--time-scale",
    type=float,
    help="1 for real time, the default of a real scanner; 0 as fast as possible.",
)
@experiment_options
def calibrate(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    plant: Path,
    scanner: str,
    out: Path | None,
    experiment: tuple[str | None, Size],
    folder: Path | None,
    seed: int,
    model: Path | None,
    rate: float | None,
    time_scale: float | None,
) -> None:
    """Drive the scanner with steps, multisines, loops and random moves, and record each.

    With --experiment, use a drive that distinguishes effects which a scan cannot. For the drives
    of another scanner see 'afm-scan plan'.
    """
    name, size = experiment
    kinds = tuple(PLANS) if name is None else (name,)
    if (model or rate) and (name is None or folder is None):
        raise click.UsageError(
            "--model and --rate change what --experiment and --export write: give both"
        )
    if folder is not None:
        export(folder, *_drives(kinds, model, size, rate))
        return
    if out is None:
        raise click.UsageError("give a folder for the bags with --out, or one with --export")
    run_calibration(plant, out, seed, time_scale, kinds, size, scanner)
    recorded = f"the simulated scanner of {plant}" if scanner == SIM else f"scanner {scanner}"
    click.echo(f"Recorded {recorded} in {out}.")
    click.echo(f"next: {_next(out, name)}")
