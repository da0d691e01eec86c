"""``afm-scan scan``: one scan, by nodes or in this process, recorded in a bag."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import click

from afm_scan_ros.cli import orders
from afm_scan_ros.cli.execution import execute_scan
from afm_scan_ros.cli.options import BAG, CONFIG, FILE, refuse_existing
from afm_scan_ros.cli.processes import setting_aside
from afm_scan_ros.cli.scanner import (
    FILES,
    ScannerChoice,
    amplifier_of,
    choose,
    exchange_of,
    limit_parameters,
    pace_of,
    scan_by_files,
    scanner_options,
    time_scale_option,
)
from afm_scan_ros.core.correction import Correction
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import DriveLimits
from afm_scan_ros.core.model import INVERSES, ScannerModel
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.files.drive_files import load_learned
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_scan
from afm_scan_ros.files.records import naming
from afm_scan_ros.nodes.inversion_parameters import ONLINE
from afm_scan_ros.nodes.parameters import FLOW, TIME_SCALE, checked, inverses_of


def run_scan(
    files: orders.ScanFiles,
    inverses: tuple[str, ...],
    time_scale: float | None = None,
    further: Mapping[str, orders.Parameters] = MappingProxyType({}),
    *,
    images: bool = False,
    watched: bool = False,
    views: Mapping[str, str] = MappingProxyType({}),
    **online: bool,
) -> None:
    """Run one scan by the file, by default in real time, or in simulation without waiting.

    ``further`` are parameters of nodes, by their names. With ``images`` it is also imaged,
    where it has lines of more samples than pixels; ``watched``, its residual too. ``views`` say
    where each viewer shows it, and ``online`` what features do during the scan. Raises InputError
    before it begins, ScanError where it stays incomplete; the bag is then set aside.
    """
    refuse_existing(files.bag)
    model = load_model(files.model)
    inverses_of(inverses, INVERSES)
    spec, flow = load_scan(files.spec, [parameter.name for parameter in FLOW])
    if time_scale is None:
        given = {"time_scale": pace_of(files.scanner), **flow}
        time_scale = float(checked(TIME_SCALE, given, str(files.spec)))
    orders.refuse_pace(time_scale)
    online = {**dict.fromkeys(ONLINE, False), **online}
    wanted = [name for name, chosen in online.items() if chosen]
    _refuse_unsuited(spec, files.scanner, wanted, views)
    correction = _correction(files.learned, spec, model, inverses)
    if (exchange := exchange_of(files.scanner)) is not None:
        scan_by_files(exchange, spec, model, inverses_of(inverses, INVERSES), files.bag, correction)
        return
    scanner = choose(files.scanner, files.plant)
    own = _own(files, scanner, online)
    every = {part: {**own.get(part, {}), **further.get(part, {})} for part in {*own, *further}}
    order = orders.ScanOrder(
        files, spec, flow, model, inverses, scanner, time_scale, every, images, watched, views
    )
    with setting_aside([files.bag]):
        execute_scan(order)


def _refuse_unsuited(
    spec: ScanSpec, scanner: str, online: Collection[str], views: Mapping[str, str]
) -> None:
    """Raise InputError for a scan that cannot be corrected, or shown, as it goes on."""
    for name, where in views.items():
        orders.VIEWS[name].refuse(where)
    for name in online:
        ONLINE[name].refuse_unsuited(spec)
    if scanner.partition(":")[0] != FILES:
        return
    if views:
        raise InputError(
            f"--scanner {scanner}: files are exchanged once a scan, so that nothing can be seen"
            f" while it runs: scan without --{' and --'.join(views)}"
        )
    if online:
        raise InputError(
            f"--scanner {scanner}: a correction during the scan needs a line's readings before a"
            " later line begins, but files are exchanged once a scan: scan without it"
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
    files: orders.ScanFiles,
    scanner: ScannerChoice,
    online: Mapping[str, bool],
) -> dict[str, orders.Parameters]:
    """Parameters of the compensator and the monitor, before those of their files."""
    learned = {"learned_file": str(files.learned)} if files.learned else {}
    own = {**learned, **online, **limit_parameters(scanner.limits)}
    tracked = {name: online[name] for name, each in ONLINE.items() if each.tracker}
    return {orders.COMPENSATOR: own, orders.MONITOR: tracked}


def drive_limits_of(scanner: str, plant: Path) -> DriveLimits:
    """Limits of a scan's drive: the scanner's, or the compensator's where these are not known."""
    if (amplifier := amplifier_of(scanner, plant)) is not None:
        return amplifier.limits
    own = orders.parameters_of(orders.COMPENSATOR)
    return DriveLimits(float(own["voltage_limit_v"]), float(own["slew_limit_v_per_s"]))


def _options_of_features(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of features to a command: a flag each, and where each viewer shows it."""
    for name, view in reversed([*orders.VIEWS.items()]):
        command = click.option(
            f"--{name}", is_flag=False, flag_value=view.usual, metavar="[FILE]", help=view.help
        )(command)
    for name, each in reversed([*ONLINE.items()]):
        flag = f"--{name.replace('_', '-')}"
        command = click.option(flag, is_flag=True, help=each.help)(command)
    return command


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
@_options_of_features
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
    **of_features: Any,  # noqa: ANN401 - a flag or a place
) -> None:
    """Make one scan and record it."""
    run_scan(
        orders.ScanFiles(spec, model, plant, bag, scanner, learned),
        tuple(name.strip() for name in inverses.split(",")),
        time_scale,
        {},
        images=True,
        watched=watched,
        views={name: of_features[name] for name in orders.VIEWS if of_features[name]},
        **{name: of_features[name] for name in ONLINE},
    )
    click.echo(f"Recorded {bag}.")
