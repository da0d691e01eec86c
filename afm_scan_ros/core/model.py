"""What is believed of a scanner: its effects, how each is known, and the model's error.

An effect that is unknown stands in the model as it was expected before the records were taken:
nearly absent, with no creep to speak of, and a hysteresis close to a straight line.

A residual below the model discrepancy shows no missing effect.

Either operator of hysteresis has limits ``lower`` and ``upper`` (V) of its input, a ``chord``
(V/V), which is the best single gain over them, and ``with_share``, which changes its part with
memory.
"""

from collections.abc import Iterable, Iterator
from enum import Enum
from typing import TypeAlias

import numpy as np
from attrs import evolve, field, fields, frozen
from attrs.converters import optional as optional_converter
from attrs.validators import ge, in_, optional

from afm_scan_ros.core.effects.base import AnyEffect, Cascade
from afm_scan_ros.core.effects.creep import CreepModel
from afm_scan_ros.core.effects.hysteresis.duhem import Duhem, DuhemSlopes
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import OutputMap, Preisach
from afm_scan_ros.core.effects.optimal_inverse import RelativeWeight, Weight
from afm_scan_ros.core.effects.sensor import SensorModel
from afm_scan_ros.core.effects.vibration import VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.spread import Spread
from afm_scan_ros.core.types import AXES, floats, pair

__all__ = [
    "INVERSES",
    "Added",
    "AxisModel",
    "CreepModel",
    "DuhemSlopes",
    "EverettSurface",
    "HysteresisModel",
    "InverseSettings",
    "ModelDiscrepancy",
    "OutputMap",
    "ScannerModel",
    "VibrationModel",
]

Range = tuple[float, float]
"""Least and greatest value."""


IDENTIFYING_KINDS = ("creep", "hysteresis", "frequency")
"""Kinds of record, of which each identifies an effect."""


class Status(Enum):
    """How an effect came into the model."""

    IDENTIFIED = "identified"
    ASSUMED = "assumed"
    UNKNOWN = "unknown"


CONFIDENT = 1.96
"""Standard deviations to either end of a 95 % interval of a normal variable."""


@frozen
class ParameterInterval:
    """95 % interval of a parameter, in ``unit``; an open end is None."""

    name: str
    unit: str
    lower: float | None = None
    upper: float | None = None

    @property
    def holds_zero(self) -> bool:
        """Whether both ends are known, with zero between them."""
        return self.lower is not None and self.upper is not None and self.lower <= 0 <= self.upper


def closed(name: str, interval: Range, unit: str) -> ParameterInterval:
    """Return an interval whose ends may be infinite as one whose ends may be open."""
    lower, upper = (float(end) if np.isfinite(end) else None for end in interval)
    return ParameterInterval(name, unit, lower, upper)


@frozen
class EffectStatus:
    """How one effect is known, and over which drive (V), frequencies (Hz) and hold times (s).

    ``identifiable_from`` is the kind of record that would identify an effect that is unknown.
    """

    status: Status = field(default=Status.IDENTIFIED, converter=Status)
    drive: Range | None = field(default=None, converter=optional_converter(pair))
    frequencies: Range | None = field(default=None, converter=optional_converter(pair))
    hold_times: Range | None = field(default=None, converter=optional_converter(pair))
    intervals: tuple[ParameterInterval, ...] = ()
    identifiable_from: str = ""

    def __attrs_post_init__(self) -> None:
        for name in ("drive", "frequencies", "hold_times"):
            given = getattr(self, name)
            if given is not None and not given[0] <= given[1]:
                raise InputError(f"{name} {given}: give the smaller end first")
        if self.status is Status.UNKNOWN and self.identifiable_from not in IDENTIFYING_KINDS:
            raise InputError(
                f"identifiable_from is {self.identifiable_from!r}:"
                f" give one of {', '.join(IDENTIFYING_KINDS)}"
            )


@frozen
class BaseEffects:
    """Status of each base effect of one axis; a model that does not state it has identified all."""

    creep: EffectStatus = EffectStatus()
    hysteresis: EffectStatus = EffectStatus()
    vibration: EffectStatus = EffectStatus()

    def each(self) -> Iterator[tuple[str, EffectStatus]]:
        """Yield name and status of each effect."""
        for effect in fields(BaseEffects):
            yield effect.name, getattr(self, effect.name)

    def unknown(self) -> Iterator[tuple[str, EffectStatus]]:
        """Yield name and status of each effect that is unknown."""
        yield from (each for each in self.each() if each[1].status is Status.UNKNOWN)


VIBRATING = 0.66
"""Share of the first resonance's frequency from which on modes that a model lacks may dominate."""
NARROWEST = 0.7
"""Share of the Nyquist frequency up to which the last band begins."""
SLOW = 0.0, 0.0022, 0.0066, 0.022, 0.066, 0.22
EDGES = (*SLOW, VIBRATING, 0.93, 1.32, 1.87, 2.64, 3.74, 5.3, 7.5, 22.0)
"""Over the first resonance; a record's bands lie between those below its Nyquist frequency.

Finer where scanners resonate: a mode that a model lacks is to spoil the band that it lies in, not
those around it.
"""


@frozen
class ModelDiscrepancy:
    """Rms (m) of measured minus predicted displacement in each band, on held-out data.

    ``bands`` are the n + 1 edges of n bands, Hz. ``rms`` is free of the sensor's ``noise``. Over
    the ``displacement`` in each band it is the relative error, by which other drives may be judged.
    Of motion that was ``fitted`` it is the error of similar motion. ``record`` is the drive.
    """

    record: str
    bands: tuple[float, ...] = field(converter=floats)
    rms: tuple[float, ...] = field(converter=floats)
    noise: tuple[float, ...] = field(converter=floats)
    displacement: tuple[float, ...] = field(converter=floats)
    fitted: bool = False

    def __attrs_post_init__(self) -> None:
        figures = np.array([len(f) for f in (self.rms, self.noise, self.displacement)])
        if len(self.bands) < 2 or np.any(figures != len(self.bands) - 1):  # noqa: PLR2004 - edges
            raise InputError(
                f"model_discrepancy has {len(self.bands)} edges of bands: give two or more, and"
                " one rms, noise_rms and displacement_rms fewer"
            )
        if self.bands[0] < 0.0 or np.any(np.diff(self.bands) <= 0.0):
            raise InputError(f"model_discrepancy: bands must ascend from 0 or more: {self.bands}")
        numbers = np.array([*self.bands, *self.rms, *self.noise, *self.displacement])
        if not np.all(np.isfinite(numbers) & (numbers >= 0.0)):
            raise InputError("model_discrepancy holds what is no rms: give finite numbers from 0")


def band_edges(sample_period: float, resonance: float) -> tuple[float, ...]:
    """Edges (Hz) of a signal's bands, a factor of 1.4 to 3 apart, up to the Nyquist frequency.

    ``resonance`` (Hz) is the first of the model.
    """
    nyquist, edges = 0.5 / sample_period, (edge_at(edge, resonance) for edge in EDGES)
    return (*(edge for edge in edges if edge < NARROWEST * nyquist), nyquist)


def edge_at(share: float, resonance: float) -> float:
    """Edge (Hz) at a share of a resonance (Hz), to three digits."""
    return float(f"{share * resonance:.3g}")


HysteresisOperator: TypeAlias = EverettSurface | DuhemSlopes


def effect_of(operator: HysteresisOperator) -> AnyEffect:
    """Return the effect from drive u (V) to effective input F (V)."""
    return Preisach(operator) if isinstance(operator, EverettSurface) else Duhem(operator)


INVERSES = ("creep", "hysteresis", "vibration")
EXACT, DIRECT, AS_IDENTIFIED = "exact", "direct", "as_identified"
"""Inverses of hysteresis; the last is whichever the model states to be better for its axis."""


@frozen
class HysteresisModel:
    """``forward``: from drive u (V) to effective input F (V); ``direct``: from F to u.

    ``output`` is the map behind a Preisach operator ``forward``, where there is one; a Duhem
    operator contains its maps. ``inverse`` names the one that compensates: the exact inverse of the
    two, or the direct surface, which is the paper's.
    """

    forward: HysteresisOperator
    direct: EverettSurface
    output: OutputMap | None = None
    inverse: str = field(default=EXACT, validator=in_((EXACT, DIRECT)))

    @property
    def surface(self) -> EverettSurface:
        """Surface of a Preisach operator ``forward``; raises InputError for another operator."""
        if isinstance(self.forward, EverettSurface):
            return self.forward
        raise InputError("the hysteresis is a Duhem operator: it has no Everett surface")

    def operator(self) -> Cascade:
        """Return the effect from u to F, whose inverse is the exact one."""
        behind = () if self.output is None else (self.output,)
        return Cascade((effect_of(self.forward), *behind))


@frozen
class Added:
    """An effect of the catalogue on an axis, with its parameters' values (SI) in their order."""

    name: str
    kind: str
    values: tuple[float, ...] = field(converter=floats)


@frozen
class AxisModel:
    """One axis: drive u (V) → hysteresis → F (V) → vibration → creep → what was ``added`` → m."""

    hysteresis: HysteresisModel
    vibration: VibrationModel
    creep: CreepModel
    model_discrepancy: ModelDiscrepancy | None = field(default=None, eq=False)
    """What is known of the model, and so no part of it when models are compared or hashed."""
    added: tuple[Added, ...] = ()
    known_elsewhere: tuple[ModelDiscrepancy, ...] = field(default=(), eq=False)
    """The same on other records, of other amplitudes or bands; these may have been fitted."""
    effects: BaseEffects = field(default=BaseEffects(), eq=False)
    """How each base effect is known, and where it holds."""
    sensor: SensorModel | None = None
    """Low-pass through which the displacement is read: predicted, and never inverted."""
    spread: Spread | None = field(default=None, eq=False, repr=False)
    """How far the scanner may be from the model; a model that no fit has made states none."""

    @property
    def read_vibration(self) -> VibrationModel:
        """The vibration as the sensor reads it."""
        return self.vibration if self.sensor is None else self.sensor.read(self.vibration)

    @property
    def reads_after(self) -> bool:
        """Whether the sensor reads the displacement after the drive's updates."""
        return self.sensor is not None and self.sensor.reads_after

    @property
    def model_discrepancies(self) -> tuple[ModelDiscrepancy, ...]:
        """All that is known of the model's error; empty where nothing is."""
        return (
            ()
            if self.model_discrepancy is None
            else (self.model_discrepancy, *self.known_elsewhere)
        )

    def also_known(self, errors: Iterable[ModelDiscrepancy]) -> "AxisModel":
        """Return the model that knows its error on further records too."""
        known = (*self.model_discrepancies, *errors)
        if not known:
            return self
        return evolve(self, model_discrepancy=known[0], known_elsewhere=known[1:])


@frozen
class ScannerModel:
    """One axis or both, independent of each other but for what was added to either."""

    x: AxisModel | None = None
    y: AxisModel | None = None

    def __attrs_post_init__(self) -> None:
        if not self.axes:
            raise InputError("a model holds no axis: give x, y or both")

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that the model holds."""
        return tuple(name for name in AXES if getattr(self, name) is not None)

    def axis(self, name: str) -> AxisModel:
        """Return the model of axis ``"x"`` or ``"y"``; raises InputError where it is absent."""
        found = {"x": self.x, "y": self.y}[name]
        if found is None:
            raise InputError(f"the model holds no axis {name}: identify {name} too")
        return found


@frozen
class InverseSettings:
    """How to invert.

    Attributes:
        hysteresis_inverse: "exact", "direct" (Croft et al. 2001) or the one that the model names.
        weight: of the optimal inverse of vibration: what a large drive costs over an error.
        preview: how far (s) that inverse looks ahead; as far as its response needs where None.
    """

    hysteresis_inverse: str = field(
        default=AS_IDENTIFIED, validator=in_((AS_IDENTIFIED, EXACT, DIRECT))
    )
    weight: Weight | RelativeWeight = field(factory=RelativeWeight)
    preview: float | None = field(
        default=None, converter=optional_converter(float), validator=optional(ge(0.0))
    )
