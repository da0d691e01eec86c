"""``afm-scan scan``: one scan, by nodes or in this process, recorded in a bag."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TypedDict, Unpack

import click

from afm_scan_ros.cli.execution import execute_scan
from afm_scan_ros.cli.options import BAG, CONFIG, FILE, refuse_existing
from afm_scan_ros.cli.orders import (
    COMPENSATOR,
    MONITOR,
    Parameters,
    ScanFiles,
    ScanOrder,
    parameters_of,
    refuse_pace,
)
from afm_scan_ros.cli.processes import set_aside
from afm_scan_ros.cli.scanner import (
    FILES,
    ScannerChoice,
    amplifier_of,
    choose,
    exchange_of,
    pace_of,
    scan_by_files,
    scanner_options,
    time_scale_option,
)
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.online.adapted_scan import refuse_without_turns
from afm_scan_ros.core.online.line_feedback import refuse_unsuited
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.learned_file import load_learned
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_scan
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.flow import FLOW, TIME_SCALE
from afm_scan_ros.nodes.parameters import checked, inverses_of


class Online(TypedDict, total=False):
    """What the compensator corrects by what was achieved; by default nothing."""

    line_feedback: bool
    """Offset, tilt and gain of each line, from those before."""
    adapt: bool
    """Changes of gain, resonance and slow creep."""


def run_scan(
    files: ScanFiles,
    inverses: tuple[str, ...],
    time_scale: float | None = None,
    further: Mapping[str, Parameters] = MappingProxyType({}),
    *,
    images: bool = False,
    watched: bool = False,
    **online: Unpack[Online],
) -> None:
    """Run one scan by the file, by default in real time, or in simulation without waiting.

    ``further`` are parameters of nodes, by their names. With ``images`` it is also imaged,
    where it has lines of more samples than pixels; ``watched``, its residual too. ``online`` says
    what is corrected during the scan. Raises InputError before it begins, ScanError where it stays
    incomplete; the bag is then set aside.
    """
    refuse_existing(files.bag)
    model = load_model(files.model)
    inverses_of(inverses, INVERSES)
    spec, flow = load_scan(files.spec, [parameter.name for parameter in FLOW])
    if time_scale is None:
        given = {"time_scale": pace_of(files.scanner), **flow}
        time_scale = float(checked(TIME_SCALE, given, str(files.spec)))
    refuse_pace(time_scale)
    corrected = {name: online.get(name) is True for name in ("line_feedback", "adapt")}
    _refuse_unsuited(spec, files.scanner, corrected)
    correction = _correction(files.learned, spec, model, inverses)
    if (exchange := exchange_of(files.scanner)) is not None:
        scan_by_files(exchange, spec, model, inverses_of(inverses, INVERSES), files.bag, correction)
        return
    scanner = choose(files.scanner, files.plant)
    own = _own(files, scanner, corrected)
    every = {part: {**own.get(part, {}), **further.get(part, {})} for part in {*own, *further}}
    order = ScanOrder(
        files, spec, flow, model, inverses, scanner, time_scale, every, images, watched
    )
    try:
        execute_scan(order)
    except (InputError, ScanError) as error:
        raise type(error)(f"{error}{set_aside([files.bag], error)}") from error


def _refuse_unsuited(spec: ScanSpec, scanner: str, online: Mapping[str, bool]) -> None:
    """Raise InputError for a scan that cannot be corrected as it goes on."""
    if online["line_feedback"]:
        refuse_unsuited(spec)
    if online["adapt"]:
        refuse_without_turns(spec)
    if any(online.values()) and scanner.partition(":")[0] == FILES:
        raise InputError(
            f"--scanner {scanner}: line feedback and adaptation need a line's readings before a"
            " later line begins, but files are exchanged once a scan: scan without them"
        )


def _correction(
    file: Path | None, spec: ScanSpec, model: ScannerModel, inverses: Sequence[str]
) -> Correction:
    """Return the learned correction of a file, or none."""
    if file is None:
        return Correction.none(spec)
    learned = load_learned(file)
    with naming(file):
        learned.refuse_other(spec, model, inverses_of(inverses, INVERSES))
    return learned.correction


def _own(
    files: ScanFiles,
    scanner: ScannerChoice,
    corrected: Mapping[str, bool],
) -> dict[str, Parameters]:
    """Parameters of the compensator and the monitor, before those of their files."""
    learned = {"learned_file": str(files.learned)} if files.learned else {}
    own = {**learned, **corrected, **_tighter_limits(scanner)}
    return {COMPENSATOR: own, MONITOR: {"adapt": corrected["adapt"]}}


def _tighter_limits(scanner: ScannerChoice) -> Parameters:
    """Limits of the scanner below the compensator's, to refuse a scan before it moves."""
    if (limits := scanner.limits) is None:
        return {}
    own = parameters_of(COMPENSATOR)
    theirs = {"voltage_limit_v": limits.voltage, "slew_limit_v_per_s": limits.slew}
    return {name: value for name, value in theirs.items() if value < own.get(name, math.inf)}


def drive_limits_of(scanner: str, plant: Path) -> DriveLimits:
    """Limits of a scan's drive: the compensator's, or the scanner's where these are tighter.

    Those of an external scanner are not known.
    """
    own = parameters_of(COMPENSATOR)
    voltage, slew = float(own["voltage_limit_v"]), float(own["slew_limit_v_per_s"])
    if (amplifier := amplifier_of(scanner, plant)) is None:
        return DriveLimits(voltage, slew)
    return DriveLimits(min(voltage, amplifier.voltage_limit), min(slew, amplifier.slew_limit))


@click.command()
@click.option("--spec", type=FILE, default=CONFIG / "scan.yaml", help="Scan file.")
@click.option("--model", type=FILE, default=CONFIG / "model.yaml", help="Model file to invert.")
@scanner_options
@click.option(
    "--inverses",
    default=",".join(INVERSES),
    show_default=True,
    help="Effects to invert, separated by commas; or none.",
)
@time_scale_option
@click.option(
    "--watch", "watched", is_flag=True, help="Compare the scanner with the model during the scan."
)
@click.option("--learned", type=FILE, help="Correction of this scan that 'afm-scan learn' wrote.")
@click.option(
    "--line-feedback",
    is_flag=True,
    help="Correct offset, tilt and gain of each line from the lines before it.",
)
@click.option(
    "--adapt",
    is_flag=True,
    help="Track changes of gain, resonance and slow creep, and scan accordingly.",
)
@click.option("--bag", required=True, type=BAG, help="Folder to create for the bag.")
def scan(  # noqa: PLR0913, PLR0917 - click hands over one parameter an option
    spec: Path,
    model: Path,
    plant: Path,
    scanner: str,
    inverses: str,
    time_scale: float | None,
    learned: Path | None,
    bag: Path,
    *,
    watched: bool,
    line_feedback: bool,
    adapt: bool,
) -> None:
    """Make one scan and record it."""
    run_scan(
        ScanFiles(spec, model, plant, bag, scanner, learned),
        tuple(name.strip() for name in inverses.split(",")),
        time_scale,
        images=True,
        watched=watched,
        line_feedback=line_feedback,
        adapt=adapt,
    )
    click.echo(f"Recorded {bag}.")
