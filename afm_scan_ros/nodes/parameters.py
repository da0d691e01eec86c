"""Parameters of the nodes: name, type, description, range; and what is made of their values."""

import sys
import time
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from math import ceil
from pathlib import Path
from typing import Any, TypeAlias

from attrs import Attribute, frozen

from afm_scan_ros.core.diagnosis.scan_monitor import Tracker
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import AmplifierSpec, DriveLimits
from afm_scan_ros.core.model import ScannerModel
from afm_scan_ros.core.scan_inversion import MakeCorrection
from afm_scan_ros.core.scan_spec import ScanSpec, human_name, scan_parameters
from afm_scan_ros.core.streams import MAX_BLOCK
from afm_scan_ros.drivers import AxisSettings, DriverChoice, ScannerSettings
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.model_file import load_model
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.files.records import converted, naming

Value: TypeAlias = bool | int | float | str | list[str]


@frozen
class NodeParameter:
    """A parameter with its default; its type is that of the default."""

    name: str
    default: Value
    description: str
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()


@frozen
class OnlineOption:
    """What a feature does while a scan runs, if the parameter and the option of its name say so.

    ``help`` is that of the option. ``parameters`` are those of the compensator, and of the monitor
    where there is a ``tracker``; ``correction`` and ``tracker`` are made by their values.
    ``refuse_unsuited`` raises InputError for a scan that cannot be corrected so.
    """

    help: str
    parameters: tuple[NodeParameter, ...]
    refuse_unsuited: Callable[[ScanSpec], None]
    correction: Callable[[Mapping[str, Any]], MakeCorrection]
    tracker: Callable[[ScannerModel, ScanSpec, Mapping[str, Any]], Tracker] | None = None


MODEL_FILE = NodeParameter(
    "model_file", str(share_directory() / "config/model.yaml"), "Model of the scanner"
)
DRIVE_LIMITS = (
    NodeParameter("voltage_limit_v", 5.0, "Largest drive voltage", low=0.0),
    NodeParameter("slew_limit_v_per_s", 2e5, "Largest slew rate of the drive", low=0.0),
)


SIMULATION = (
    NodeParameter("plant_file", str(share_directory() / "config/plant.yaml"), "Simulated scanner"),
    NodeParameter("seed", 1, "Seed of the sensor's noise", low=0),
    NodeParameter(
        "age_s", 0.0, "Time since the scanner was switched on, at the scan's start", low=0.0
    ),
    NodeParameter("output_log", "", "File for the outputs and their moments; empty for none"),
    *DRIVE_LIMITS,
)
_METRES = AxisSettings(1.0, 0.0, -sys.float_info.max, sys.float_info.max)
"""The simulated sensor reads metres, and checks its own range."""


def simulated_scanner(settings: Mapping[str, Any], where: str) -> DriverChoice:
    """Return the simulated scanner by the parameters ``SIMULATION``; its sensor cannot be lost.

    Raises InputError where the plant file, or a limit, is wrong.
    """
    with naming("parameter plant_file"):
        load_plant(Path(settings["plant_file"]))
    limits = drive_limits(settings)
    scanner = ScannerSettings(
        AmplifierSpec(limits.voltage, limits.slew, limits.slew),
        _METRES,
        _METRES,
        latency_samples=0,
        response_time=1.0,
        drive_resolution=2.0 * limits.voltage,
        sampling_instant="before_update",
    )
    own = {name: settings[name] for name in ("plant_file", "seed", "output_log")}
    return DriverChoice("simulated", scanner, own | {"age": settings["age_s"]}, where)


def drive_limits(settings: Mapping[str, Any]) -> DriveLimits:
    """Return the limits among a node's parameters; raises InputError where one is zero."""
    try:
        return DriveLimits(settings["voltage_limit_v"], settings["slew_limit_v_per_s"])
    except ValueError as error:
        raise InputError(f"voltage_limit_v and slew_limit_v_per_s: {error}") from error


def model_of(settings: Mapping[str, Any]) -> ScannerModel:
    """Load the model that a node's parameter names; raises InputError naming parameter and file."""
    with naming("parameter model_file"):
        return load_model(Path(settings["model_file"]))


def scan_spec_parameters() -> list[NodeParameter]:
    """Return the parameters of a scan in their file units, such as ``range_x_um``."""
    return [_for_people(attribute) for attribute in scan_parameters()]


def checked(parameter: NodeParameter, given: Mapping[str, Any], where: str) -> Any:  # noqa: ANN401 - of the default's type
    """Return a parameter's value; raises InputError, naming ``where``, where it does not fit."""
    value: Any = given.get(parameter.name, parameter.default)
    at = f"{where}: {parameter.name}"
    if isinstance(parameter.default, float) and type(value) is int:
        value = float(value)
    value = converted(type(parameter.default), value, 1.0, at)
    if parameter.choices and value not in parameter.choices:
        raise InputError(f"{at} = '{value}' is not one of {', '.join(parameter.choices)}")
    if parameter.low is not None and value < parameter.low:
        raise InputError(f"{at} = {value:g} is below {parameter.low:g}: give more")
    if parameter.high is not None and value > parameter.high:
        raise InputError(f"{at} = {value:g} is above {parameter.high:g}: give less")
    return value


def inverses_of(names: Iterable[str], known: Iterable[str]) -> frozenset[str]:
    """Return the inverses that a parameter names; ``none`` stands for none of them."""
    given = frozenset(names)
    if "none" in given and len(given) > 1:
        raise InputError(f"inverses: 'none' cannot be combined with {', '.join(sorted(given))}")
    chosen = given - {"none"}
    if unknown := sorted(chosen - frozenset(known)):
        raise InputError(f"inverses: '{unknown[0]}' is not one of {', '.join(known)}, none")
    return chosen


def _for_people(attribute: "Attribute[Any]") -> NodeParameter:
    """Return a scan's parameter in the unit of its name, with the range that its checks allow."""
    default: Any = attribute.default
    scale = attribute.metadata["scale"]
    bounds: dict[str, Any] = {}
    for check in attribute.metadata["checks"]:
        if hasattr(check, "options"):
            bounds["choices"] = tuple(check.options)
        else:
            side = "low" if check.compare_op.startswith(">") else "high"
            bounds[side] = _in_unit(check.bound, scale)
    if isinstance(default, float):
        default = _in_unit(default, scale)
    return NodeParameter(human_name(attribute), default, attribute.metadata["help"], **bounds)


def _in_unit(value: float, scale: float) -> float:
    return float(f"{value / scale:.12g}")  # 40e-6 / 1e-6 is 39.99… otherwise


STOPPED = "stopped by request"
"""Begins the reason of a scan that is done, though not whole."""

MAX_MESSAGE_RATE = 200.0
"""Messages a second that a topic may carry in real time."""

USUAL_RATE = 50.0
"""Blocks a second of scan time, where nobody states their size: rclpy passes on a thousand."""
LEAST_BLOCK = 100
"""Samples."""
USUAL_WINDOW = 20
"""Blocks: 0.4 s of a scan, in which the inverse's preview and two blocks have to fit."""

TIME_SCALE = NodeParameter(
    "time_scale", 1.0, "Duration over scan time: 1 for real time, 0 for no pacing", low=0.0
)
FLOW = (
    NodeParameter(
        "block_size",
        0,
        f"Samples in a block; 0 for {USUAL_RATE:g} blocks a second of the scan, of"
        f" {LEAST_BLOCK} to {MAX_BLOCK} samples",
        low=0,
        high=MAX_BLOCK,
    ),
    NodeParameter(
        "window",
        0,
        f"Largest lead over the slowest node, in samples; 0 for {USUAL_WINDOW} blocks",
        low=0,
    ),
    TIME_SCALE,
    NodeParameter("min_subscriptions", 2, "Readers that the scan waits for", low=0),
    NodeParameter("scan_id", "", "Name of the scan; empty for its start time"),
    NodeParameter(
        "sampling_instant",
        "before_update",
        "When the sensor's samples are taken, seen from the converter's update",
        choices=("before_update", "after_update"),
    ),
    NodeParameter("trigger_offset_s", 0.0, "Time from the converter's update to the sample"),
)


def block_size_at(sample_period: float) -> int:
    """Return how many samples a block has where nobody says it; ``sample_period`` in s."""
    return min(MAX_BLOCK, max(LEAST_BLOCK, ceil(1.0 / (USUAL_RATE * sample_period) - 1e-9)))


def identity(scan_id: str) -> tuple[str, int]:
    """Return a scan's id, by default its start time, and the time, ns, at which it begins."""
    start = time.time_ns()
    moment = datetime.fromtimestamp(start / 1e9, UTC)
    return scan_id or moment.strftime("%Y%m%dT%H%M%S.%fZ"), start


def taking_part(*nodes: str) -> NodeParameter:
    """Declare the nodes that take part in a scan beside its source."""
    return NodeParameter(
        "required_nodes", list(nodes), "Nodes that take part, in the order of data flow"
    )
