"""``afm-scan scan``: one scan by separate processes, recorded in a bag."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TypedDict, Unpack

import click
from attrs import evolve, frozen

from afm_scan_ros.cli.options import BAG, CONFIG, FILE, refuse_existing
from afm_scan_ros.cli.processes import NodeCommand, pace, run_nodes, set_aside, watching
from afm_scan_ros.cli.scanner import (
    FILES,
    SIM,
    ScannerChoice,
    amplifier_of,
    choose,
    exchange_of,
    pace_of,
    scan_by_files,
    scanner_options,
    time_scale_option,
)
from afm_scan_ros.core.compensation import preview_of
from afm_scan_ros.core.effects.vibration import DEFAULT_PREVIEW
from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.learning.adapted_scan import refuse_without_turns
from afm_scan_ros.core.learning.correction import Correction
from afm_scan_ros.core.learning.line_feedback import refuse_unsuited
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import TO_AND_FRO
from afm_scan_ros.files import yaml
from afm_scan_ros.files.learned_file import load_learned
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_scan, node_parameters
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.flow import FLOW
from afm_scan_ros.nodes.parameters import inverses_of

COMPENSATOR = "inversion_compensator"
PIXELS = 256
"""In a line of the images shown."""


Parameters = Mapping[str, object]


@frozen
class ScanFiles:
    """What a scan is made from, and the folder of the bag that it ends in.

    ``plant`` is that of the ``scanner`` sim. ``learned`` is a learned correction of this scan.
    """

    spec: Path
    model: Path
    plant: Path
    bag: Path
    scanner: str = SIM
    learned: Path | None = None


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
    spec, others = load_scan(files.spec, [parameter.name for parameter in FLOW])
    if time_scale is None:
        time_scale = float(others.get("time_scale", pace_of(files.scanner)))
    if not 0.0 <= time_scale < math.inf:
        raise InputError(f"time_scale = {time_scale:g}: give 1 for real time, 0 for no pacing")
    corrected = {name: online.get(name) is True for name in ("line_feedback", "adapt")}
    _refuse_unsuited(spec, files.scanner, corrected)
    correction = _correction(files.learned, spec, model, inverses)
    if (exchange := exchange_of(files.scanner)) is not None:
        scan_by_files(exchange, spec, model, inverses_of(inverses, INVERSES), files.bag, correction)
        return
    scanner = choose(files.scanner, files.plant)
    beside = [
        *_imager(spec, images=images),
        *_monitor(files.model, watched=watched, adapt=corrected["adapt"]),
    ]
    commands = _commands(files, scanner, list(inverses), time_scale, beside, corrected)
    ahead = _looking_ahead(model, spec) if "vibration" in inverses else {}
    own = {**_tighter_limits(scanner), **ahead, **further.get(COMPENSATOR, {})}
    further = {**further, COMPENSATOR: own}
    paced = pace(time_scale)
    try:
        with watching(f"scan to {files.bag}") as idle:
            given = [_with_further(c, {**paced, **further.get(c.name, {})}) for c in commands]
            run_nodes(given, idle, [scanner.node])
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


def _imager(spec: ScanSpec, *, images: bool) -> list[NodeCommand]:
    imaged = int((0.5 - spec.overscan) * spec.samples_per_line)
    if not images or spec.pattern not in TO_AND_FRO or imaged <= PIXELS:
        return []
    return [NodeCommand("scan_imager", {"pixels": PIXELS}, CONFIG / "scan_imager.yaml")]


def _monitor(model: Path, *, watched: bool, adapt: bool) -> list[NodeCommand]:
    if not watched:
        return []
    parameters = {"model_file": str(model), "min_subscriptions": 1, "adapt": adapt}
    return [NodeCommand("residual_monitor", parameters, CONFIG / "residual_monitor.yaml")]


def _looking_ahead(model: ScannerModel, spec: ScanSpec) -> Parameters:
    """Preview that a model needs beyond the default, or nothing: of a file, the user sets it."""
    needed = preview_of(model, spec.sample_period, DEFAULT_PREVIEW)
    return {"preview_ms": 1e3 * needed} if needed > DEFAULT_PREVIEW else {}


def _tighter_limits(scanner: ScannerChoice) -> Parameters:
    """Limits of the scanner below the compensator's, to refuse a scan before it moves."""
    if (limits := scanner.limits) is None:
        return {}
    path = CONFIG / f"{COMPENSATOR}.yaml"
    own = node_parameters(yaml.load(path), str(path), COMPENSATOR)
    theirs = {"voltage_limit_v": limits.voltage, "slew_limit_v_per_s": limits.slew}
    return {name: value for name, value in theirs.items() if value < own.get(name, math.inf)}


def drive_limits_of(scanner: str, plant: Path) -> DriveLimits:
    """Limits of a scan's drive: the compensator's, or the scanner's where these are tighter.

    Those of an external scanner are not known.
    """
    path = CONFIG / f"{COMPENSATOR}.yaml"
    own = node_parameters(yaml.load(path), str(path), COMPENSATOR)
    voltage, slew = float(own["voltage_limit_v"]), float(own["slew_limit_v_per_s"])
    if (amplifier := amplifier_of(scanner, plant)) is None:
        return DriveLimits(voltage, slew)
    return DriveLimits(min(voltage, amplifier.voltage_limit), min(slew, amplifier.slew_limit))


def _with_further(command: NodeCommand, parameters: Parameters) -> NodeCommand:
    return evolve(command, parameters={**command.parameters, **parameters})


def _commands(
    files: ScanFiles,
    scanner: ScannerChoice,
    inverses: list[str],
    time_scale: float,
    beside: Sequence[NodeCommand],
    online: Mapping[str, bool],
) -> list[NodeCommand]:
    """All nodes of a scan; those ``beside`` only read the topics of the others.

    ``online`` says whether the compensator corrects by what was achieved, and how.
    """
    names = [command.name for command in beside]
    model: dict[str, object] = {"model_file": str(files.model), "inverses": inverses}
    learned = {"learned_file": str(files.learned)} if files.learned else {}
    own: dict[str, object] = {**learned, **online}
    source = {
        "required_nodes": [COMPENSATOR, scanner.node, "tracking_monitor", "scan_recorder", *names],
        "min_subscriptions": 3 + names.count("scan_imager"),
        "time_scale": time_scale,
        **scanner.source,
    }
    drive_readers = {"min_subscriptions": 3 + names.count("residual_monitor")}
    recorded = {"bag": str(files.bag), "topics": ["desired_displacement", *scanner.topics]}
    readers = {"min_subscriptions": 2 + len(names) + any(online.values())}
    return [
        NodeCommand("scan_recorder", recorded, CONFIG / "scan_recorder.yaml"),
        NodeCommand("tracking_monitor", {"min_subscriptions": 1}),
        *beside,
        *(_with_further(command, readers) for command in scanner.commands),
        NodeCommand(
            COMPENSATOR, model | drive_readers | own, CONFIG / "inversion_compensator.yaml"
        ),
        NodeCommand("trajectory_generator", model | source, files.spec),
    ]


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
