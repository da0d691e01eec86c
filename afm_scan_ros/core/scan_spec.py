"""The parameters of a scan, read by YAML files, nodes and messages."""

import math
from collections.abc import Callable
from numbers import Integral, Real
from typing import Any

from attrs import Attribute, evolve, field, fields, frozen
from attrs.validators import ge, gt, in_, le, lt

from afm_scan_ros.core.errors import InputError

PATTERNS = ("raster", "sinusoidal", "spiral", "lissajous")
PREPARATIONS = ("depolarise", "saturate", "none")
SMALLEST_RANGE, LARGEST_RANGE = 1e-9, 1e-3
PLAUSIBLE = (ge(SMALLEST_RANGE), le(LARGEST_RANGE))
REACHED = (ge(-LARGEST_RANGE), le(LARGEST_RANGE))
"""Ranges and displacements, m, of a piezoscanner: what lies outside was meant in another unit."""
MOST_PER_LINE = 10**7
"""Samples in a line; one is held in memory whole."""
FASTEST = 1e7
"""Samples a second."""
LONGEST = 1e12
"""Samples in a scan, four months of it at 100 kHz."""
UNITS = {"": "", "_um": "m", "_hz": "Hz", "_ms": "s", "_s": "s"}
SCALES = {"_um": 1e-6, "_ms": 1e-3}
"""SI units of parameters, by the suffixes of their names for people, and sizes other than 1."""


def parameter(
    default: float | str,
    help: str,  # noqa: A002 - the word that every reader knows
    *checks: Callable[..., Any],
    suffix: str = "",
) -> Any:  # noqa: ANN401 - attrs types the field by its annotation
    """Declare one scan parameter: SI inside, ``name + suffix`` in its unit for people."""
    metadata = {"help": help, "suffix": suffix, "scale": SCALES.get(suffix, 1.0), "checks": checks}
    return field(default=default, validator=_refuse_other, metadata=metadata)


def _refuse_other(_: object, attribute: "Attribute[Any]", value: object) -> None:
    """Raise InputError for a value of another type or out of range, and say what to give."""
    if not (_is_like(attribute.default, value) and _is_within(attribute, value)):
        raise InputError(f"{attribute.name} = {value!r}: give {_allowed(attribute)}")


def _is_like(default: object, value: object) -> bool:
    """Whether a value is text, a whole number or a finite number, as the default is."""
    if isinstance(default, str):
        return isinstance(value, str)
    kind = Integral if isinstance(default, int) else Real
    return isinstance(value, kind) and not isinstance(value, bool) and math.isfinite(value)


def _is_within(attribute: "Attribute[Any]", value: object) -> bool:
    try:
        for check in attribute.metadata["checks"]:
            check(None, attribute, value)
    except ValueError:
        return False
    return True


def _allowed(attribute: "Attribute[Any]") -> str:
    checks, default = attribute.metadata["checks"], attribute.default
    if isinstance(default, str):
        return f"one of {', '.join(checks[0].options)}"
    what = "a whole number" if isinstance(default, int) else "a number"
    bounds = " and ".join(f"{check.compare_op} {check.bound:g}" for check in checks)
    unit = UNITS[attribute.metadata["suffix"]]
    return " ".join(filter(None, (what, bounds, unit and f"in {unit}"))) + f", as {default:g}"


@frozen
class ScanSpec:
    """A scan, in SI units: m, Hz, s; InputError for parameters out of range, or that contradict."""

    pattern: str = parameter("raster", "Path of the scan", in_(PATTERNS))
    range_x: float = parameter(
        40e-6, "Peak-to-peak motion in x, turn-arounds included", *PLAUSIBLE, suffix="_um"
    )
    range_y: float = parameter(40e-6, "Peak-to-peak motion in y", *PLAUSIBLE, suffix="_um")
    line_rate: float = parameter(
        5.0, "To-and-fro lines (turns of a spiral) a second", gt(0.0), suffix="_hz"
    )
    lines: int = parameter(16, "To-and-fro lines (turns) in the scan", ge(2))
    samples_per_line: int = parameter(
        4000, "Samples in one whole to-and-fro, even", ge(8), le(MOST_PER_LINE)
    )
    turnaround: float = parameter(
        0.1, "Share of each half-period spent turning round; 0 is a sharp corner", ge(0.0), lt(1.0)
    )
    overscan: float = parameter(
        0.0, "Share of the range at each end that is scanned but not imaged", ge(0.0), lt(0.5)
    )
    y_step: float = parameter(2e-3, "Duration of the smooth y step", gt(0.0), suffix="_ms")
    preparation: str = parameter(
        "depolarise", "How the scanner's memory is set before the scan", in_(PREPARATIONS)
    )
    preparation_lower: float = parameter(
        0.0, "Lowest of the preparation, from the centre; 0: 0.6 of the larger range", suffix="_um"
    )
    preparation_upper: float = parameter(
        0.0, "Highest of the preparation, from the centre; 0: 0.6 of the larger range", suffix="_um"
    )
    preparation_rate: float = parameter(
        10.0, "Oscillations of the preparation a second", gt(0.0), suffix="_hz"
    )
    preparation_cycles: int = parameter(15, "Oscillations of the preparation", ge(1))
    approach: float = parameter(
        0.1, "Time from rest at zero to the first line", gt(0.0), suffix="_s"
    )
    settle: float = parameter(
        0.1, "Time from the last line to rest at the centre", gt(0.0), suffix="_s"
    )
    centre_x: float = parameter(0.0, "Displacement in the scan's middle, x", *REACHED, suffix="_um")
    centre_y: float = parameter(0.0, "Displacement in the scan's middle, y", *REACHED, suffix="_um")

    def __attrs_post_init__(self) -> None:
        for name, end in self._preparation_of_range().items():
            stated = getattr(self, name)
            if stated in (0.0, end):
                object.__setattr__(self, name, end)
                continue
            _refuse(
                not SMALLEST_RANGE <= abs(stated) <= LARGEST_RANGE,
                f"{name} = {stated:g} m: give {SMALLEST_RANGE:g} to {LARGEST_RANGE:g} m to either"
                " side, or 0 for 0.6 of the larger range",
            )
        _refuse(
            self.samples_per_line % 2 == 1,
            f"samples_per_line = {self.samples_per_line} is odd, so the trace and the retrace"
            f" would differ: give {self.samples_per_line + 1}",
        )
        self._refuse_endless()
        _refuse(
            not self.preparation_lower < 0.0 < self.preparation_upper,
            "preparation_lower and preparation_upper must lie on either side of zero:"
            f" {self.preparation_lower:g} m and {self.preparation_upper:g} m do not",
        )
        _refuse(
            self.preparation != "none" and self.preparation_rate * self.sample_period > 1 / 8,
            f"preparation_rate = {self.preparation_rate:g} Hz leaves fewer than 8 samples a cycle:"
            f" give at most {1 / (8 * self.sample_period):g} Hz or more samples_per_line",
        )
        for name in ("approach", "settle"):
            _refuse(
                getattr(self, name) < self.sample_period,
                f"{name} = {getattr(self, name):g} s is shorter than one sample, so the scanner"
                f" would jump: give at least {self.sample_period:g} s or more samples_per_line",
            )
        if self.pattern in ("raster", "sinusoidal"):
            self._refuse_y_step()

    def _refuse_endless(self) -> None:
        """Refuse what no converter keeps up with and no one waits for."""
        rate = self.line_rate * self.samples_per_line
        _refuse(
            rate > FASTEST,
            f"line_rate and samples_per_line make {rate:g} samples a second: give at most"
            f" {FASTEST:g}",
        )
        duration = self.lines / self.line_rate + self.approach + self.settle
        duration += self.preparation_cycles / self.preparation_rate
        _refuse(
            duration * rate > LONGEST,
            f"preparation, approach, lines and settle take {duration:g} s, {duration * rate:g}"
            f" samples: give at most {LONGEST:g}",
        )

    def _refuse_y_step(self) -> None:
        """Refuse a y step that is not over when the next trace's constant-speed part begins."""
        room = 0.5 * (1.0 + self.turnaround) / self.line_rate
        _refuse(
            self.y_step > room,
            f"y_step = {self.y_step:g} s is longer than turn-around and retrace together:"
            f" give at most {room:g} s",
        )
        _refuse(
            self.y_step < self.sample_period,
            f"y_step = {self.y_step:g} s is shorter than one sample, so y would jump:"
            f" give at least {self.sample_period:g} s or more samples_per_line",
        )

    def _preparation_of_range(self) -> dict[str, float]:
        """Ends of a preparation, m, where nothing states them.

        It has to go farther than the scan, and to stay within the 1.4 times its range that a
        calibration drives, with the width of the hysteresis and what compensation adds.
        """
        end = 0.6 * max(self.range_x, self.range_y)
        return {"preparation_lower": -end, "preparation_upper": end}

    def resized(self, range_x: float, range_y: float) -> "ScanSpec":
        """Return the scan with other ranges, m, which its preparation follows if it does these."""
        lower, upper = (
            0.0 if getattr(self, name) == end else getattr(self, name)
            for name, end in self._preparation_of_range().items()
        )
        ranged = evolve(self, range_x=range_x, range_y=range_y)
        return evolve(ranged, preparation_lower=lower, preparation_upper=upper)

    def extent(self, axis: str) -> tuple[float, float]:
        """Return the centre and the range of an axis, m."""
        return getattr(self, f"centre_{axis}"), getattr(self, f"range_{axis}")

    @property
    def sample_period(self) -> float:
        """Seconds between samples."""
        return 1.0 / (self.line_rate * self.samples_per_line)


def _refuse(wrong: bool, message: str) -> None:  # noqa: FBT001 - reads as "refuse if"
    if wrong:
        raise InputError(message)


def human_name(attribute: "Attribute[Any]") -> str:
    """Name of a parameter where people write it: with its unit, as in ``range_x_um``."""
    return attribute.name + str(attribute.metadata["suffix"])


def scan_parameters() -> tuple["Attribute[Any]", ...]:
    """All parameters of a scan, in order, with default, checks, help, suffix and scale."""
    return fields(ScanSpec)
