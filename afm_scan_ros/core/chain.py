"""One axis as a chain of elements, from drive to displacement, into which further ones can be put.

    drive u (V) → [drive elements] → hysteresis → F (V) → vibration → creep
                → + what the other axis adds → [output elements] → m

See coupling.py for what the axes add to each other.
"""

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from attrs import evolve, frozen

from afm_scan_ros.core.cascade import AnyEffect, Cascade
from afm_scan_ros.core.coupled_system import SampledCoupling
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.gain import Gain
from afm_scan_ros.core.effects.hysteresis.direct import DirectInverse
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import INVERSES, AxisModel, InverseSettings
from afm_scan_ros.core.types import Array

Maker = Callable[[float], AnyEffect]
"""Makes an element for a sample period in s."""
HysteresisMaker = Callable[[EverettSurface, float], AnyEffect]
"""Makes a hysteresis of an Everett surface, for a sample period in s."""


class CouplingElement(Protocol):
    """What the other axis adds to this one."""

    @property
    def sampled(self) -> SampledCoupling:
        """The same as equations of a sample, by which both axes' coupling is inverted."""
        ...

    def at_rest(self) -> Any:  # noqa: ANN401 - each element's own
        """State before the first sample."""
        ...

    def apply(self, state: Any, other: Array) -> tuple[Any, Array]:  # noqa: ANN401 - its own
        """What a block of the other axis' own displacement (m) adds to this one (m), both (n,)."""
        ...


@frozen(eq=False)
class Stage:
    """A part of the chain: ``make`` gives its elements for a sample period in s.

    Two stages of equal ``parts`` are the same. ``coupling`` is what the other axis adds before it.
    """

    parts: tuple[object, ...]
    make: Callable[[float], tuple[AnyEffect, ...]]
    coupling: tuple[Callable[[float], CouplingElement], ...] = ()


def rate_independent(surface: EverettSurface, _sample_period: float) -> AnyEffect:
    """Preisach's hysteresis, to which time means nothing."""
    return Preisach(surface)


@frozen(eq=False)
class Chain:
    """The elements of one axis: the model's, and those that were put in beside them.

    ``hysteresis`` makes that of the model, from its Everett surface and the sample period (s).
    """

    model: AxisModel
    drive: tuple[Maker, ...] = ()
    hysteresis: HysteresisMaker = rate_independent
    output: tuple[Maker, ...] = ()
    coupling: tuple[Callable[[float], CouplingElement], ...] = ()
    before: VibrationModel | None = None
    """The vibration, where an effect has come to multiply it and all that the model lacks."""
    elsewhere: tuple["Chain", ...] = ()
    """The chain of each further record, where something in it is the record's own."""

    def of_record(self, number: int) -> "Chain":
        """Return the chain of a record."""
        return self.elsewhere[number - 1] if number and self.elsewhere else self

    def with_drive(self, maker: Maker) -> "Chain":
        """Chain with one more element between the amplifier's input and the hysteresis.

        Its inverse gives as many samples as it takes: it does not look ahead.
        """
        return evolve(self, drive=(maker, *self.drive))

    def with_hysteresis(self, maker: HysteresisMaker) -> "Chain":
        """Chain with another hysteresis in the place of the model's.

        Raises InputError where it has been replaced already, for the first would be lost.
        """
        if self.hysteresis is not rate_independent:
            raise InputError("the hysteresis is replaced already: keep one of the two")
        return evolve(self, hysteresis=maker)

    def with_output(self, maker: Maker) -> "Chain":
        """Chain with one more element between what both axes do and sensor."""
        return evolve(self, output=(*self.output, maker))

    def stages(self) -> tuple[Stage, ...]:
        """Return the model's stages: hysteresis, vibration, creep, output."""
        model = self.model
        return (
            Stage(
                (self.drive, self.hysteresis, model.hysteresis),
                lambda t: (
                    *(maker(t) for maker in self.drive),
                    self.hysteresis(model.hysteresis.forward, t),
                ),
            ),
            Stage((model.vibration,), lambda t: (Vibration(model.vibration, t),)),
            Stage((model.creep,), lambda t: (Creep(model.creep, t),)),
            Stage((self.coupling, self.output), self._output, self.coupling),
        )

    def forward(self, sample_period: float) -> Cascade:
        """Return the model from drive (V) to displacement (m), the other axis at rest."""
        return Cascade(self.alone(sample_period).effects + self.output_of(sample_period).effects)

    def alone(self, sample_period: float) -> Cascade:
        """Return the model from drive (V) to what the axis does of itself (m)."""
        *before, _ = self.stages()
        return Cascade(tuple(e for stage in before for e in stage.make(sample_period)))

    def output_of(self, sample_period: float) -> Cascade:
        """Return the output elements, from what both axes do (m) to displacement (m)."""
        return Cascade(self._output(sample_period))

    def compensator(
        self, sample_period: float, inverses: Iterable[str], settings: InverseSettings
    ) -> Cascade:
        """Return the cascade whose inverse compensates the effects named in ``inverses``.

        Each other effect is replaced by one gain: creep by 1, vibration by G(0), hysteresis by
        the slope of the major loop from end to end. Drive elements go with the hysteresis, output
        elements with any inverse. Its four effects are what comes before vibration, vibration,
        creep, and the output elements. Raises InputError for an unknown inverse.
        """
        wanted = _known(inverses)
        model, period = self.model, sample_period
        hysteresis: tuple[AnyEffect, ...] = (Gain(model.hysteresis.forward.chord),)
        if "hysteresis" in wanted:
            hysteresis = (
                *(maker(period) for maker in self.drive),
                self._inverted(settings, period),
            )
        vibration: AnyEffect = Gain(model.vibration.static_gain)
        if "vibration" in wanted:
            vibration = self.vibration(period, settings)
        creep: AnyEffect = Creep(model.creep, period) if "creep" in wanted else Gain(1.0)
        output = self._output(period) if wanted else ()
        return Cascade((_one(hysteresis), vibration, creep, _one(output)))

    def vibration(self, sample_period: float, settings: InverseSettings) -> Vibration:
        """Return the vibration whose inverse is designed as ``settings`` say."""
        design = evolve(settings.design(), before=self.before)
        return Vibration(self.model.vibration, sample_period, design)

    def _output(self, sample_period: float) -> tuple[AnyEffect, ...]:
        return tuple(maker(sample_period) for maker in self.output)

    def _inverted(self, settings: InverseSettings, sample_period: float) -> AnyEffect:
        if settings.hysteresis_inverse == "exact":
            return self.hysteresis(self.model.hysteresis.forward, sample_period)
        if self.hysteresis is not rate_independent:
            raise InputError(
                "hysteresis_inverse is direct, but the model's hysteresis depends on rate: the"
                " direct inverse does not know this; choose exact"
            )
        return DirectInverse(self.model.hysteresis.direct)


def _one(effects: tuple[AnyEffect, ...]) -> AnyEffect:
    return effects[0] if len(effects) == 1 else Cascade(effects)


def _known(inverses: Iterable[str]) -> frozenset[str]:
    wanted = frozenset(inverses)
    if not wanted <= frozenset(INVERSES):
        unknown = min(wanted - frozenset(INVERSES))
        raise InputError(f"no inverse is named {unknown!r}: choose among {', '.join(INVERSES)}")
    return wanted
