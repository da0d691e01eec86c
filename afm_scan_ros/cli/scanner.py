"""The option --scanner: the simulation, a driver, files, or a node that somebody else started."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from pathlib import Path
from typing import Any

import click
from attrs import evolve, field, frozen
from click.core import ParameterSource

from afm_scan_ros.bag.writer import write_record
from afm_scan_ros.cli.options import CONFIG, FILE, positive
from afm_scan_ros.cli.progress import working
from afm_scan_ros.core.compensation import Compensation
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.identification.drives.excitation import Plan, excitation_block
from afm_scan_ros.core.limits import AmplifierSpec, DriveLimits
from afm_scan_ros.core.model import InverseSettings, ScannerModel
from afm_scan_ros.core.scan_info import ScanInfo, info_of_scan
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import desired, total_samples
from afm_scan_ros.core.types import Trace
from afm_scan_ros.drivers import DEFAULTS, OURS, load_settings, settings_file
from afm_scan_ros.drivers.files import FileExchange
from afm_scan_ros.files.model_file import model_hash
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes import lacking_ros

FILES = "files"


def exchange_of(scanner: str) -> FileExchange | None:
    """Return the exchange of ``files:FILE``, None for another scanner."""
    kind, _, file = scanner.partition(":")
    return FileExchange(load_settings(FILES, Path(file))) if kind == FILES and file else None


def record_by_files(exchange: FileExchange, plan: Plan, bag: Path) -> None:
    """Record one drive in a bag."""
    drive = excitation_block(plan, 0, plan.total_samples)
    info = ScanInfo(bag.name, time.time_ns(), plan.name, plan.sample_period, plan.total_samples)
    _record(exchange, bag, info, {"drive_voltage": drive})


def scan_by_files(
    exchange: FileExchange,
    spec: ScanSpec,
    model: ScannerModel,
    inverses: Iterable[str],
    bag: Path,
    correction: Correction,
) -> None:
    """Record one scan in a bag, with a change of its reference."""
    inverses = tuple(sorted(inverses))
    limits = exchange.settings.amplifier.limits
    compensation = Compensation(model, spec.sample_period, inverses, InverseSettings(), limits)
    drive = compensation.whole(correction.reference())
    target = desired(spec, 0, total_samples(spec))
    info = evolve(
        info_of_scan(spec, bag.name, time.time_ns()),
        inverses=inverses,
        model_hash=model_hash(model),
    )
    _record(exchange, bag, info, {"desired_displacement": target, "drive_voltage": drive})


def _record(exchange: FileExchange, bag: Path, info: ScanInfo, given: dict[str, Trace]) -> None:
    with working(f"record {bag.name}") as report:
        moved = exchange.displacement(bag.name, given["drive_voltage"], report)
    settings = exchange.settings
    info = evolve(
        info,
        sampling_instant=settings.sampling_instant,
        trigger_offset=settings.trigger_offset,
    )
    write_record(bag, info, {**given, "achieved_displacement": moved})


SIM, EXTERNAL = "sim", "external"
SIMULATED = SIM, "simulated"
"""Scanners that the default model describes."""
DRIVER_NODE, SIM_NODE = SCANNERS = ("scanner_driver", "piezoscanner_sim")
"""Names that the node of a scanner has."""
PATIENCE = 60.0
"""Longest wait (s) for an external scanner, where nobody says another."""
_WAIT = "afm_scan_ros.scanner_wait"
"""Key of the longest wait in what click keeps of a command."""
PLANT = CONFIG / "plant.yaml"


@frozen
class ScannerChoice:
    """A scanner by its node, and what the other parts of a scan need to know of it.

    ``parameters`` are its own, before those of its file; ``external`` says that somebody else
    starts it. ``source`` are parameters of the scan's source.
    """

    node: str
    parameters: Mapping[str, object] = field(factory=dict)
    limits: DriveLimits | None = None
    knows_true: bool = False
    source: Mapping[str, object] = field(factory=dict)
    external: bool = False

    @property
    def topics(self) -> list[str]:
        """Topics of blocks that the scanner reads and publishes."""
        true = ["true_displacement"] if self.knows_true else []
        return ["drive_voltage", "achieved_displacement", *true]


def choose(scanner: str, plant: Path = PLANT) -> ScannerChoice:
    """Return the scanner of the option; waits for an external one.

    Raises InputError where the option, or a file, is wrong.
    """
    if scanner == EXTERNAL:
        return _external()
    if scanner == SIM:
        limits = load_plant(plant).amplifier.limits
        own = {"plant_file": str(plant), **limit_parameters(limits)}
        return ScannerChoice(SIM_NODE, own, limits, knows_true=True)
    driver, file = driver_and_file(scanner)
    settings = load_settings(driver, file).settings
    source = {
        "sampling_instant": settings.sampling_instant,
        "trigger_offset_s": settings.trigger_offset,
    }
    of_driver = {"driver": driver, "settings_file": str(file)}
    return ScannerChoice(DRIVER_NODE, of_driver, settings.amplifier.limits, source=source)


def limit_parameters(limits: DriveLimits | None) -> Mapping[str, object]:
    """Parameters of a node by the limits of the scanner's drive; none where they are not known."""
    if limits is None:
        return {}
    return {"voltage_limit_v": limits.voltage, "slew_limit_v_per_s": limits.slew}


def _external() -> ScannerChoice:
    if lacking := lacking_ros():
        raise InputError(f"--scanner {EXTERNAL}: {lacking}; a scanner node needs ROS 2")
    from afm_scan_ros.cli.listening import found_scanner  # noqa: PLC0415 - needs ROS

    context = click.get_current_context(silent=True)
    wait = PATIENCE if context is None else float(context.meta.get(_WAIT, PATIENCE))
    node, known = found_scanner(SCANNERS, wait)
    return ScannerChoice(node, knows_true=known, external=True)


def amplifier_of(scanner: str, plant: Path = PLANT) -> AmplifierSpec | None:
    """Amplifier of the scanner of the option; None of an external one, which does not state it."""
    if scanner == EXTERNAL:
        return None
    if scanner == SIM:
        return load_plant(plant).amplifier
    if exchange := exchange_of(scanner):
        return exchange.settings.amplifier
    driver, file = driver_and_file(scanner)
    return load_settings(driver, file).settings.amplifier


def pace_of(scanner: str) -> float:
    """Return the time scale of a scanner by default: real time, but for the simulation."""
    return 0.0 if scanner == SIM else 1.0


time_scale_option = click.option(
    "--time-scale",
    type=float,
    help="1 for real time, the default of a real scanner; 0 as fast as possible.",
)


def scanner_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options --scanner and --plant to a command, which gets both."""

    @click.option(
        "--scanner",
        default=SIM,
        show_default=True,
        metavar="sim|external|files:FILE|DRIVER[:FILE]",
        help="sim; external, a scanner node that is running already; files, by which another"
        " program moves the scanner; or a driver, as module:Class, with its settings file.",
    )
    @click.option(
        "--plant",
        type=FILE,
        show_default="config/plant.yaml",
        help="With --scanner sim: the simulated scanner. For an experiment, give that of the"
        " diagnosed records.",
    )
    @click.option(
        "--wait",
        type=positive("s"),
        expose_value=False,
        callback=_keep_wait,
        show_default="60s",
        help="With --scanner external: longest wait for it.",
    )
    @wraps(command)
    def with_scanner(scanner: str, plant: Path | None, **options: Any) -> None:  # noqa: ANN401 - the command's own
        if plant is not None and scanner != SIM:
            raise click.UsageError("--plant is the simulated scanner: give it with --scanner sim")
        if lacking := [*_settings_lacking(scanner), *_model_lacking(scanner)]:
            raise InputError(f"--scanner {scanner}: {'; '.join(lacking)}")
        command(scanner=scanner, plant=plant or PLANT, **options)

    return with_scanner


def _settings_lacking(scanner: str) -> Iterator[str]:
    if scanner in (SIM, EXTERNAL):
        return
    driver, file = _driver_and_text(scanner)
    if not file and driver not in DEFAULTS:
        yield f"give its settings, as --scanner {driver}:stage.yaml"


def _model_lacking(scanner: str) -> Iterator[str]:
    """Say so where a real scanner would be driven by the model of the simulated one."""
    context = click.get_current_context()
    model = context.params.get("model")
    default = context.get_parameter_source("model") is ParameterSource.DEFAULT
    if model is not None and default and scanner.partition(":")[0] not in SIMULATED:
        yield (
            "give this scanner's model by --model FILE: another scanner's may drive its resonance."
            f" To use the simulated scanner's on purpose, give --model {model}"
        )


def _keep_wait(ctx: click.Context, _: click.Parameter, seconds: float | None) -> None:
    if seconds is not None:
        ctx.meta[_WAIT] = seconds


def driver_and_file(scanner: str) -> tuple[str, Path]:
    """Return the parts of DRIVER[:FILE], with the default of FILE; refuses any other text."""
    driver, file = _driver_and_text(scanner)
    if driver == FILES:
        raise InputError(
            f"--scanner {scanner}: no node exchanges files: give it to a command of afm-scan"
        )
    with naming(f"--scanner {scanner}"):
        return driver, settings_file(driver, file)


def _driver_and_text(scanner: str) -> tuple[str, str]:
    """Return the parts of DRIVER[:FILE]; raises InputError for a text of another form."""
    first, _, rest = scanner.partition(":")
    if first in (*OURS, FILES):
        driver, file = first, rest
    else:
        kind, _, file = rest.partition(":")
        driver = f"{first}:{kind}"
    if driver.endswith(":"):
        raise InputError(
            f"--scanner {scanner!r}: give {SIM}, {EXTERNAL}, {FILES}:FILE, {', '.join(OURS)} or"
            " module:Class, and :FILE for the scanner's settings"
        )
    return driver, file
