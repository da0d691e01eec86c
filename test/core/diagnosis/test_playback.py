"""Only the stages of a chain that changed are evaluated again."""

import numpy as np
import paper
import pytest

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.diagnosis.records import AxisSignals, Playback
from afm_scan_ros.core.effects.base import Cascade
from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.types import Array

COUNT = 400
BASE = Chain(paper.axis())
FORMS = [(each.name, form.kind) for each in CATALOGUE for form in each.forms]
STAGES = 4


@pytest.fixture
def evaluated(monkeypatch: pytest.MonkeyPatch) -> list[Cascade]:
    """Cascades of the stages that were evaluated, in their order."""
    called: list[Cascade] = []
    apply = Cascade.apply

    def counted(self: Cascade, state: tuple[object, ...], block: Array) -> object:
        called.append(self)
        return apply(self, state, block)

    monkeypatch.setattr(Cascade, "apply", counted)
    return called


def playback() -> Playback:
    drive = paper.smooth_target(1, COUNT, 3.0)
    other = 1e-6 * paper.smooth_target(2, COUNT, 3.0)
    return Playback(AxisSignals("record", 5e-5, drive, np.zeros(COUNT), other))


def inserted(chain: Chain, name: str, kind: str, *values: float) -> Chain:
    return effect_type(name).form(kind).insert(chain, np.array(values))


@pytest.mark.parametrize(("name", "kind"), FORMS)
def test_equal_values_give_equal_stages(name: str, kind: str, evaluated: list[Cascade]) -> None:
    values = effect_type(name).form(kind).example
    played, chains = playback(), [inserted(BASE, name, kind, *values) for _ in range(2)]
    assert chains[0].stages() == chains[1].stages()
    assert hash(chains[0].stages()) == hash(chains[1].stages())
    first = played.displacement(chains[0])
    evaluated.clear()
    assert np.array_equal(played.displacement(chains[1]), first)
    assert not evaluated


FILM = ("rate_dependent_hysteresis", "film", 2e-4)


@pytest.mark.parametrize(
    ("before", "after", "count"),
    [
        (("drift", "", 1e-8, 10.0), ("drift", "", 2e-8, 10.0), 1),
        (("parameter_shift", "creep", 1.1, 1.0), ("parameter_shift", "creep", 1.2, 1.0), 2),
        (("delay", "", 1e-5), ("delay", "", 2e-5), 3),
        (("input_lag", "", 1e-5), ("input_lag", "", 2e-5), STAGES + 1),
    ],
)
def test_only_what_follows_a_change_is_evaluated(
    before: tuple[str, str, float],
    after: tuple[str, str, float],
    count: int,
    evaluated: list[Cascade],
) -> None:
    """Beside a film, of which one evaluation takes longer than all others together.

    The first stage is evaluated at rest too.
    """
    played = playback()
    first = played.displacement(inserted(inserted(BASE, *FILM), *before))
    evaluated.clear()
    changed = inserted(inserted(BASE, *FILM), *after)
    found = played.displacement(changed)
    assert len(evaluated) == count
    assert not np.array_equal(found, first)
    assert np.array_equal(found, playback().displacement(changed))
