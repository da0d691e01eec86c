"""A file's content, read by other means than the package's own, to compare its reading with."""

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from afm_scan_bench.faults.injection.outcome import LossError
from afm_scan_ros.core.model import (
    AxisModel,
    CreepModel,
    EverettSurface,
    HysteresisModel,
    ScannerModel,
    VibrationModel,
)
from afm_scan_ros.core.types import AXES

_TRUE = frozenset(["y", "yes", "true", "on"])
_OCTAL = re.compile(r"[-+]?0[0-7]+")


def written(path: Path) -> dict[str, Any]:
    """Content of a YAML file, every value the text that stands there."""
    content: dict[str, Any] = yaml.load(path.read_text("utf-8"), Loader=yaml.BaseLoader)  # noqa: S506 - it makes words alone
    return content


def refuse_other(stated: Any, read: Any, where: str = "") -> None:  # noqa: ANN401 - whatever YAML holds
    """Raise LossError where a value was read that is not the one that is written."""
    if isinstance(stated, Mapping):
        for key, value in stated.items():
            if key not in read:
                raise LossError(f"{where}{key} is not read")
            refuse_other(value, read[key], f"{where}{key}: ")
    elif isinstance(stated, list):
        if len(stated) != len(read):
            raise LossError(f"{where}{len(stated)} values are {len(read)}")
        for value, each in zip(stated, read, strict=True):
            refuse_other(value, each, where)
    elif not _same(stated, read):
        raise LossError(f"{where}{stated} is read as {read!r}")


def written_model(path: Path) -> ScannerModel:
    """Model of a file; what it adds to the chain is not read."""
    content = written(path)
    arrays = dict(np.load(path.parent / content["arrays"]))
    sensitivity = number(content["sensor_sensitivity_m_per_v"])

    def surface(stated: Mapping[str, str]) -> EverettSurface:
        lower, upper, offset = (number(stated[f"{key}_v"]) for key in ("lower", "upper", "offset"))
        return EverettSurface(lower, upper, arrays[stated["values"]], offset)

    def axis(stated: Mapping[str, Any]) -> AxisModel:
        hysteresis, vibration, creep = (stated[k] for k in ("hysteresis", "vibration", "creep"))
        return AxisModel(
            HysteresisModel(surface(hysteresis["forward"]), surface(hysteresis["direct"])),
            VibrationModel(
                tuple(sensitivity * number(each) for each in vibration["numerator_v_per_v"]),
                tuple(map(number, vibration["denominator"])),
                number(vibration.get("delay_s", "0")),
            ),
            CreepModel(
                tuple(map(number, creep["gains"])), tuple(map(number, creep["time_constants_s"]))
            ),
        )

    return ScannerModel(**{name: axis(content[name]) for name in AXES})


def number(text: str) -> float:
    """Number that a text stands for, as C reads it."""
    if _OCTAL.fullmatch(text):
        return int(text, 8)
    plain = text.replace("_", "?").replace(".inf", "inf").replace(".nan", "nan")
    return float.fromhex(plain) if "x" in plain.lower() else float(plain)


def _same(stated: str, read: object) -> bool:
    if isinstance(read, bool):
        return read == (stated.lower() in _TRUE)
    if isinstance(read, int | float):
        meant = number(stated)
        alike = math.isclose(meant, read, rel_tol=1e-12, abs_tol=1e-300)
        return alike or (math.isnan(meant) and math.isnan(read))
    return stated == read
