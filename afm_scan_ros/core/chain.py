"""The model of one axis as a chain of elements from drive to displacement.

    drive u (V) → [drive elements] → hysteresis → F (V) → vibration (→ the sensor's low-pass)
                → creep → + what the other axis adds → [output elements] → m

See scanner.py for what the axes add to each other.
"""

from collections.abc import Iterable
from typing import Any

from attrs import evolve, frozen

from afm_scan_ros.core.coupled_system import SampledCoupling
from afm_scan_ros.core.effects.base import AnyEffect, Cascade, ChainElement, Element, Gain
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.preisach import DirectInverse, OutputMap
from afm_scan_ros.core.effects.vibration import Vibration, VibrationModel
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import (
    AS_IDENTIFIED,
    DIRECT,
    INVERSES,
    AxisModel,
    HysteresisOperator,
    InverseSettings,
    effect_of,
)


@frozen
class Stage:
    """Consecutive elements of a chain, after the ``coupling`` that the other axis adds."""

    elements: tuple[ChainElement[AnyEffect], ...]
    coupling: tuple[Element[SampledCoupling], ...] = ()

    def at(self, sample_period: float) -> Cascade:
        """Return the effects of the elements at a sample period (s)."""
        return Cascade(tuple(element.at(sample_period) for element in self.elements))


def rate_independent(operator: HysteresisOperator, _sample_period: float) -> AnyEffect:
    """The model's own hysteresis, which does not depend on time."""
    return effect_of(operator)


RATE_INDEPENDENT: Element[AnyEffect] = Element(rate_independent)


@frozen(eq=False)
class Chain:
    """Elements of one axis; ``hysteresis`` lacks its first parameter, the operator of the model."""

    model: AxisModel
    drive: tuple[ChainElement[AnyEffect], ...] = ()
    hysteresis: Element[AnyEffect] = RATE_INDEPENDENT
    output: tuple[ChainElement[AnyEffect], ...] = ()
    coupling: tuple[Element[SampledCoupling], ...] = ()
    before: VibrationModel | None = None
    """The vibration, where an effect has come to multiply it and all that the model lacks."""
    elsewhere: tuple["Chain", ...] = ()
    """The chain of each further record, where something in it is the record's own."""

    def of_record(self, number: int) -> "Chain":
        """Return the chain of a record."""
        return self.elsewhere[number - 1] if number and self.elsewhere else self

    def with_model(self, **effects: Any) -> "Chain":  # noqa: ANN401 - each effect's own
        """Chain of which the model has other effects."""
        return evolve(self, model=evolve(self.model, **effects))

    def with_vibration(self, **changed: Any) -> "Chain":  # noqa: ANN401 - as of evolve
        """Chain of which the vibration has another numerator, denominator or delay."""
        return self.with_model(vibration=evolve(self.model.vibration, **changed))

    def multiplied(self, numerator: Iterable[float], denominator: Iterable[float]) -> "Chain":
        """Chain of which the vibration has other polynomials, by an effect that multiplies it.

        It multiplies what the model lacks too. So the inverse keeps to the motion that its weight
        was chosen for, and excites a mode beyond the model no more.
        """
        changed = self.with_vibration(numerator=numerator, denominator=denominator)
        return evolve(changed, before=self.before or self.model.vibration)

    def with_drive(self, element: ChainElement[AnyEffect]) -> "Chain":
        """Chain with one more element before the hysteresis, whose inverse does not look ahead."""
        return evolve(self, drive=(element, *self.drive))

    def with_hysteresis(self, element: Element[AnyEffect]) -> "Chain":
        """Chain with another hysteresis in the place of the model's.

        Raises InputError where it has been replaced already, or is no Preisach operator.
        """
        _ = self.model.hysteresis.surface
        if self.hysteresis != RATE_INDEPENDENT:
            raise InputError("the hysteresis is replaced already: keep one of the two")
        return evolve(self, hysteresis=element)

    def with_coupling(self, element: Element[SampledCoupling]) -> "Chain":
        """Chain to which the other axis adds one thing more."""
        return evolve(self, coupling=(*self.coupling, element))

    def with_output(self, element: ChainElement[AnyEffect]) -> "Chain":
        """Chain with one more element between what both axes do and the sensor."""
        return evolve(self, output=(*self.output, element))

    def stages(self) -> tuple[Stage, ...]:
        """Return the model's stages: hysteresis, vibration, creep, output."""
        return (
            Stage((*self.drive, self.hysteresis_of(self.model.hysteresis.forward), *self._map)),
            Stage((Element(Vibration, (self.model.read_vibration,)),)),
            Stage((Element(Creep, (self.model.creep,)),)),
            Stage(self.output, self.coupling),
        )

    def forward(self, sample_period: float) -> Cascade:
        """Return the model from drive (V) to displacement (m), the other axis at rest."""
        return Cascade(self.alone(sample_period).effects + self.output_of(sample_period).effects)

    def alone(self, sample_period: float) -> Cascade:
        """Return the model from drive (V) to the axis' own displacement (m), without coupling."""
        *before, _ = self.stages()
        return Cascade(tuple(e for stage in before for e in stage.at(sample_period).effects))

    def output_of(self, sample_period: float) -> Cascade:
        """Return the output elements, from what both axes do (m) to displacement (m)."""
        return Stage(self.output).at(sample_period)

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
                *(element.at(period) for element in self.drive),
                *self._inverted(settings, period),
            )
        vibration: AnyEffect = Gain(model.vibration.static_gain)
        if "vibration" in wanted:
            vibration = self.vibration(period, settings)
        creep: AnyEffect = Creep(model.creep, period) if "creep" in wanted else Gain(1.0)
        output = self.output_of(period).effects if wanted else ()
        return Cascade((_one(hysteresis), vibration, creep, _one(output)))

    def vibration(self, sample_period: float, settings: InverseSettings) -> Vibration:
        """Return the vibration whose inverse is designed by the ``settings``."""
        design = settings.weight, settings.preview, self.before
        return Vibration(self.model.vibration, sample_period, *design)

    def hysteresis_of(self, operator: HysteresisOperator) -> Element[AnyEffect]:
        """Return the hysteresis with an operator."""
        return evolve(self.hysteresis, parameters=(operator, *self.hysteresis.parameters))

    @property
    def _map(self) -> tuple[OutputMap, ...]:
        """The map behind the hysteresis, where there is one."""
        behind = self.model.hysteresis.output
        return () if behind is None else (behind,)

    def _inverted(self, settings: InverseSettings, sample_period: float) -> tuple[AnyEffect, ...]:
        """Hysteresis as its inverse sees it: the direct one does not know that it depends on rate.

        Where such a model states that the direct one is better, the exact one is used.
        """
        known, wanted = self.model.hysteresis, settings.hysteresis_inverse
        if wanted == DIRECT and self.hysteresis != RATE_INDEPENDENT:
            raise InputError(
                "hysteresis_inverse is direct, but the model's hysteresis depends on rate: the"
                " direct inverse does not know this; choose exact"
            )
        if wanted == AS_IDENTIFIED and self.hysteresis == RATE_INDEPENDENT:
            wanted = known.inverse
        if wanted == DIRECT:
            return (DirectInverse(known.direct),)
        return self.hysteresis_of(known.forward).at(sample_period), *self._map


def _one(effects: tuple[AnyEffect, ...]) -> AnyEffect:
    return effects[0] if len(effects) == 1 else Cascade(effects)


def _known(inverses: Iterable[str]) -> frozenset[str]:
    wanted = frozenset(inverses)
    if not wanted <= frozenset(INVERSES):
        unknown = min(wanted - frozenset(INVERSES))
        raise InputError(f"no inverse is named {unknown!r}: choose among {', '.join(INVERSES)}")
    return wanted
