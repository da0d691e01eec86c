"""Parameters of the nodes: name, type, description, range; and what is made of their values."""

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from attrs import Attribute, frozen

from afm_scan_ros.core.diagnosis.monitor import ALARM_RATIO, LINES
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, SmoothWeight, Weight
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.limits import AmplifierSpec, DriveLimits
from afm_scan_ros.core.model import INVERSES, InverseSettings, ScannerModel
from afm_scan_ros.core.online import TIME_CONSTANT
from afm_scan_ros.core.online.line_feedback import LEAD
from afm_scan_ros.core.scan_inversion import InversionSettings
from afm_scan_ros.core.scan_spec import human_name, scan_parameters
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


MODEL_FILE = NodeParameter(
    "model_file", str(share_directory() / "config/model.yaml"), "Model of the scanner"
)
DRIVE_LIMITS = (
    NodeParameter("voltage_limit_v", 5.0, "Largest drive voltage", low=0.0),
    NodeParameter("slew_limit_v_per_s", 2e5, "Largest slew rate of the drive", low=0.0),
)


ADAPTATION = (
    NodeParameter(
        "adapt",
        default=False,
        description="Whether changes of gain, resonance and slow creep are tracked",
    ),
    NodeParameter(
        "adapt_time_constant_s", TIME_CONSTANT, "With adapt: memory of the estimator", low=0.0
    ),
)


_DEFAULT, _WEIGHT = InverseSettings(), RelativeWeight()
INVERSION = (
    NodeParameter("inverses", list(INVERSES), "Effects to invert: creep, ...; or none"),
    NodeParameter(
        "hysteresis_inverse",
        _DEFAULT.hysteresis_inverse,
        "Inverse of hysteresis: exact, the paper's direct inverse, or the model's choice",
        choices=("as_identified", "exact", "direct"),
    ),
    NodeParameter(
        "weight_corner_hz",
        0.0,
        f"Frequency above which the inverse limits the drive; 0 for {_WEIGHT.corner:g}"
        " times the first resonance",
        low=0.0,
    ),
    NodeParameter("weight_order", _WEIGHT.order, "Steepness of that transition", low=1, high=10),
    NodeParameter(
        "preview_ms",
        0.0,
        "Preview of the inverse; 0 for as long as its response needs",
        low=0.0,
        high=1000.0,
    ),
    *DRIVE_LIMITS,
    NodeParameter("learned_file", "", "Learned correction of this scan; empty for none"),
    NodeParameter(
        "preflight_samples",
        5_000_000,
        "Largest scan, in samples, that is inverted before it begins",
        low=0,
    ),
    NodeParameter(
        "line_feedback",
        default=False,
        description="Whether offset, tilt and gain are corrected from the last lines",
    ),
    NodeParameter(
        "feedback_latency_ms",
        LEAD * 1e3,
        "With line_feedback or adapt: longest time from a sample's drive to its reading",
        low=0.0,
        high=10_000.0,
    ),
    *ADAPTATION,
)
ALARMS = (
    NodeParameter(
        "alarm",
        ALARM_RATIO,
        "Residual over model discrepancy that makes a line suspect",
        low=1.0,
    ),
    NodeParameter("alarm_lines", LINES, "Suspect lines in a row that raise the alarm", low=1),
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


def inversion_settings(settings: Mapping[str, Any]) -> InversionSettings:
    """Return how a scan is inverted by the parameters ``INVERSION``; refuses limits of zero."""
    given = settings
    return InversionSettings(
        inverses_of(given["inverses"], INVERSES),
        drive_limits(given),
        InverseSettings(
            hysteresis_inverse=given["hysteresis_inverse"],
            weight=_weight(given["weight_corner_hz"], given["weight_order"]),
            preview=given["preview_ms"] * 1e-3 or None,
        ),
        line_feedback=given["line_feedback"],
        adapt=given["adapt"],
        latency=given["feedback_latency_ms"] * 1e-3,
        time_constant=given["adapt_time_constant_s"],
    )


def _weight(corner: float, order: int) -> Weight | RelativeWeight:
    return SmoothWeight(corner, order) if corner else RelativeWeight(order=order)


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
