"""A chain is the model's elements in order; what is put in stands where it was put."""

import numpy as np
import paper
import pytest
from attrs import evolve, frozen

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.coupled_system import memoryless
from afm_scan_ros.core.diagnosis.records import AxisSignals, Playback
from afm_scan_ros.core.effects.base import Element, Gain, StatelessEffect
from afm_scan_ros.core.effects.creep import Creep
from afm_scan_ros.core.effects.hysteresis.everett import EverettSurface
from afm_scan_ros.core.effects.hysteresis.preisach import Preisach
from afm_scan_ros.core.effects.vibration import Vibration
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import INVERSES, InverseSettings
from afm_scan_ros.core.types import Array

PERIOD = 5e-5
AXIS = paper.axis()
CHAIN = Chain(AXIS)
DRIVE = np.random.default_rng(1).uniform(-3.0, 3.0, 400)


@frozen
class Shift(StatelessEffect):
    """Adds a constant; apart from a gain it shows in which order elements stand."""

    amount: float

    def output(self, inputs: Array) -> Array:
        return inputs + self.amount

    def input(self, outputs: Array) -> Array:
        return outputs - self.amount


def as_its_chord(surface: EverettSurface, _sample_period: float) -> Gain:
    """Hysteresis without loops."""
    return Gain(surface.chord)


def played(*effects: object, drive: Array = DRIVE) -> Array:
    signal = drive
    for effect in effects:
        signal = effect.apply(effect.at_rest(), signal)[1]
    return signal


def answer(chain: Chain) -> Array:
    return played(chain.forward(PERIOD))


MODEL = (
    Preisach(AXIS.hysteresis.forward),
    Vibration(AXIS.vibration, PERIOD),
    Creep(AXIS.creep, PERIOD),
)


def test_a_bare_chain_is_the_papers_cascade() -> None:
    assert np.array_equal(answer(CHAIN), played(*MODEL))


def test_a_later_drive_element_stands_before_the_earlier() -> None:
    """Both act before the hysteresis: the one found last is nearest to the converter."""
    chain = CHAIN.with_drive(Gain(0.5)).with_drive(Shift(0.2))
    assert np.array_equal(answer(chain), played(Shift(0.2), Gain(0.5), *MODEL))


def test_a_later_output_element_stands_behind_the_earlier() -> None:
    chain = CHAIN.with_output(Gain(0.5)).with_output(Shift(1e-6))
    assert np.array_equal(answer(chain), played(*MODEL, Gain(0.5), Shift(1e-6)))


def test_an_output_element_meets_what_the_other_axis_adds_too() -> None:
    """Springs that yield, a play or a sensor feel where the axis is, whatever moved it there."""
    share = Element(memoryless, (0.1, 0.0))
    x = CHAIN.with_output(Gain(0.5)).with_output(Shift(1e-6))
    x = evolve(x, coupling=(share,))
    other = np.random.default_rng(2).normal(0.0, 1e-6, 400)
    view = AxisSignals("record", PERIOD, DRIVE, np.zeros(400), other)
    expected = 0.5 * (played(*MODEL) + 0.1 * other) + 1e-6
    assert Playback(view).displacement(x) == pytest.approx(expected, abs=1e-15)


def test_hysteresis_can_be_another() -> None:
    chain = evolve(CHAIN, hysteresis=Element(as_its_chord))
    chord = AXIS.hysteresis.forward.chord
    assert answer(chain) == pytest.approx(played(Gain(chord), *MODEL[1:]))


def test_the_compensator_inverts_what_was_put_in_with_what_it_belongs_to() -> None:
    """Drive elements with the hysteresis, output elements with any inverse."""
    chain = CHAIN.with_drive(Gain(0.5)).with_output(Shift(1e-6))
    targets = np.full(10, 3e-6)
    gains = AXIS.hysteresis.forward.chord, AXIS.vibration.static_gain
    creep, preisach = MODEL[2], MODEL[0]
    for inverses, expected in (
        ((), targets / gains[0] / gains[1]),
        (("creep",), creep.invert(creep.inverse_at_rest(), targets - 1e-6)[1] / np.prod(gains)),
        (
            ("hysteresis",),
            preisach.invert(preisach.inverse_at_rest(), (targets - 1e-6) / gains[1])[1] / 0.5,
        ),
    ):
        cascade = chain.compensator(PERIOD, inverses, InverseSettings())
        found = cascade.invert(cascade.inverse_at_rest(), targets)[1]
        assert found == pytest.approx(expected, rel=1e-12)


def test_a_hysteresis_of_another_kind_has_no_direct_inverse() -> None:
    chain = evolve(CHAIN, hysteresis=Element(as_its_chord))
    with pytest.raises(InputError, match="direct inverse does not know this; choose exact"):
        chain.compensator(PERIOD, INVERSES, InverseSettings(hysteresis_inverse="direct"))


@pytest.mark.parametrize("changed", range(4))
def test_a_stage_changes_with_its_own_parts_alone(changed: int) -> None:
    """So that a fit need not play the others again."""
    others = (
        CHAIN.with_drive(Gain(1.0)),
        evolve(CHAIN, model=evolve(AXIS, vibration=evolve(AXIS.vibration, delay=1e-5))),
        evolve(CHAIN, model=evolve(AXIS, creep=evolve(AXIS.creep, gains=(0.1, 0.1, 0.1)))),
        CHAIN.with_output(Gain(1.0)),
    )
    pairs = zip(CHAIN.stages(), others[changed].stages(), strict=True)
    assert [a == b for a, b in pairs] == [i != changed for i in range(4)]
