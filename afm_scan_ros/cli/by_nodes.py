"""A scan or a record by nodes, a process each; needs ROS."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

from attrs import evolve

from afm_scan_ros.cli import orders
from afm_scan_ros.cli.listening import watching
from afm_scan_ros.cli.options import CONFIG
from afm_scan_ros.cli.processes import PATIENCE, NodeCommand, isolate, run_nodes
from afm_scan_ros.cli.scanner import SIM_NODE, ScannerChoice
from afm_scan_ros.core.errors import ScanError
from afm_scan_ros.core.scan_inversion import ScanInversion
from afm_scan_ros.core.scan_spec import ScanSpec
from afm_scan_ros.core.trajectory import TO_AND_FRO, total_samples
from afm_scan_ros.files.drive_files import save_drive
from afm_scan_ros.nodes.inversion_parameters import INVERSION, ONLINE, inversion_settings
from afm_scan_ros.nodes.parameters import USUAL_WINDOW, block_size_at

CORRECTED = 2.0
"""Steps of the drive that corrections may add, learned or fed back: as much as the scan itself."""
PIXELS = 256
"""In a line of the images shown."""


def scan(order: orders.ScanOrder) -> None:
    """Scan; raises InputError before it begins, ScanError where it stays incomplete."""
    paced = _pace(order.time_scale)
    commands = [_with(c, {**paced, **order.own.get(c.name, {})}) for c in _scan_commands(order)]
    _run(commands, order.scanner, f"scan to {order.files.bag}", order.views)


def record(order: orders.RecordOrder) -> None:
    """Drive the scanner through a plan; raises as ``scan`` does."""
    with TemporaryDirectory() as folder:
        drive_file = save_drive(Path(folder), order.plan)
        paced = _pace(order.time_scale)
        commands = [_with(command, paced) for command in _record_commands(order, drive_file)]
        _run(commands, order.scanner, order.title)


def _run(
    commands: Sequence[NodeCommand],
    scanner: ScannerChoice,
    title: str,
    views: Mapping[str, str] = MappingProxyType({}),
) -> None:
    if not scanner.external:
        isolate()
    with watching(title) as (watch, idle), ExitStack() as open_views:
        for name, where in views.items():
            open_views.enter_context(orders.VIEWS[name].beside_nodes(where, watch.shown))
        for node in run_nodes(commands, idle, [scanner.node]):
            for warning in node.warnings:  # which a listener that met the node late has not heard
                watch.tell(node.name, warning)


def _pace(time_scale: float) -> orders.Parameters:
    """Return the parameters of every node for the pace; without one, a block may take long."""
    if time_scale:
        return {"time_scale": time_scale}
    return {"time_scale": 0.0, "real_time": False, "liveness_timeout_s": PATIENCE}


def _with(command: NodeCommand, parameters: orders.Parameters) -> NodeCommand:
    return evolve(command, parameters={**command.parameters, **parameters})


def _scanner_commands(scanner: ScannerChoice, own: orders.Parameters) -> list[NodeCommand]:
    """Return the scanner's node, unless somebody else starts it."""
    if scanner.external:
        return []
    file = orders.file_of(SIM_NODE) if scanner.node == SIM_NODE else None
    return [NodeCommand(scanner.node, {**scanner.parameters, **own}, file)]


def _record_commands(order: orders.RecordOrder, drive_file: Path) -> list[NodeCommand]:
    scanner = order.scanner
    source = {
        "drive_file": str(drive_file),
        "required_nodes": [scanner.node, "scan_recorder"],
        "time_scale": order.time_scale,
        **scanner.source,
    }
    return [
        NodeCommand("scan_recorder", {"bag": str(order.bag), "topics": scanner.topics}),
        *_scanner_commands(scanner, order.own),
        NodeCommand("excitation_generator", source),
    ]


def _scan_commands(order: orders.ScanOrder) -> list[NodeCommand]:
    """Return all nodes of a scan; imager and monitors only read the topics of the others."""
    files, scanner = order.files, order.scanner
    beside = [*_imager(order.spec, images=order.images), *_monitor(order)]
    names = [command.name for command in beside]
    required = [orders.COMPENSATOR, scanner.node, "tracking_monitor", "scan_recorder", *names]
    model: dict[str, object] = {
        "model_file": str(files.model),
        "inverses": list(order.inverses),
    }
    fed_back = any(order.own[orders.COMPENSATOR].get(name) for name in ONLINE)
    inversion = _inversion(order)
    source = {
        **_window(order, inversion),
        "required_nodes": required,
        "min_subscriptions": 3 + names.count("scan_imager"),
        "time_scale": order.time_scale,
        **scanner.source,
    }
    drive_readers = {"min_subscriptions": 3 + names.count(orders.MONITOR)}
    recorded = {"bag": str(files.bag), "topics": ["desired_displacement", *scanner.topics]}
    readers = {"min_subscriptions": 2 + len(names) + fed_back}
    return [
        NodeCommand("scan_recorder", recorded, orders.file_of("scan_recorder")),
        NodeCommand("tracking_monitor", {"min_subscriptions": 1}),
        *beside,
        *_scanner_commands(scanner, {**readers, "step_limit_v": _step_limit(order, inversion)}),
        NodeCommand(orders.COMPENSATOR, model | drive_readers, orders.file_of(orders.COMPENSATOR)),
        NodeCommand("trajectory_generator", model | source, files.spec),
    ]


def _inversion(order: orders.ScanOrder) -> ScanInversion:
    """Return the scan's inversion, by the model alone."""
    own = orders.settings_of(orders.COMPENSATOR, INVERSION, order.own.get(orders.COMPENSATOR, {}))
    given = inversion_settings({**own, "inverses": order.inverses})
    given = evolve(given, corrections=())
    return ScanInversion(order.model, order.spec, given)


def _window(order: orders.ScanOrder, inversion: ScanInversion) -> orders.Parameters:
    """Return a window that holds what the inverse looks ahead, where the usual one does not."""
    size = order.flow.get("block_size") or block_size_at(order.spec.sample_period)
    least = inversion.held_back + 2 * size
    fits = order.flow.get("window") or USUAL_WINDOW * size >= least
    return {} if fits else {"window": least}


def _step_limit(order: orders.ScanOrder, inversion: ScanInversion) -> float:
    """Return the largest step of the drive (V) that a scan needs, with room for its corrections.

    0 for none, where the scan is too long to be inverted before it begins or cannot be driven: the
    compensator says why.
    """
    own = orders.settings_of(orders.COMPENSATOR, INVERSION, order.own.get(orders.COMPENSATOR, {}))
    samples = total_samples(order.spec)
    if samples > own["preflight_samples"]:
        return 0.0
    try:
        return CORRECTED * inversion.largest_step(samples)
    except ScanError:
        return 0.0


def _imager(spec: ScanSpec, *, images: bool) -> list[NodeCommand]:
    imaged = int((0.5 - spec.overscan) * spec.samples_per_line)
    if not images or spec.pattern not in TO_AND_FRO or imaged <= PIXELS:
        return []
    return [NodeCommand("scan_imager", {"pixels": PIXELS}, CONFIG / "scan_imager.yaml")]


def _monitor(order: orders.ScanOrder) -> list[NodeCommand]:
    if not order.watched:
        return []
    parameters = {"model_file": str(order.files.model), "min_subscriptions": 1}
    return [NodeCommand(orders.MONITOR, parameters, orders.file_of(orders.MONITOR))]
