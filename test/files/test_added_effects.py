"""Effects that were added to a model come back from its file, and nonsense is refused."""

from pathlib import Path

import pytest
from attrs import evolve
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_scan_ros.core.effects.registry import CATALOGUE, effect_type
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.model import Added
from afm_scan_ros.files import yaml
from afm_scan_ros.files.model_file import (
    AddedEffect,
    added_from,
    added_to,
    load_model,
    model_hash,
    save_model,
)

MODEL = Path(__file__).parents[2] / "config" / "model.yaml"
FORMS = [(each.name, form.kind) for each in CATALOGUE for form in each.forms]


def values_of(name: str, kind: str) -> st.SearchStrategy[tuple[float, ...]]:
    parameters = effect_type(name).form(kind).parameters
    return st.tuples(*(st.floats(p.lower, p.upper) for p in parameters))


any_effect = st.sampled_from(FORMS).flatmap(
    lambda form: st.builds(Added, st.just(form[0]), st.just(form[1]), values_of(*form))
)


@settings(deadline=None, max_examples=200)
@given(effects=st.lists(any_effect, max_size=3))
def test_any_effect_comes_back(effects: list[Added]) -> None:
    assert added_from(added_to(effects), Scale()) == tuple(effects)


@pytest.mark.parametrize(("name", "kind"), FORMS)
def test_a_model_with_an_effect_comes_back(name: str, kind: str, tmp_path: Path) -> None:
    base = load_model(MODEL)
    added = Added(name, kind, effect_type(name).form(kind).neutral)
    model = evolve(base, y=evolve(base.y, added=(added,)))
    save_model(tmp_path / "extended.yaml", model, "a model")
    back = load_model(tmp_path / "extended.yaml")
    assert back.y.added == (added,)
    assert back.x.added == ()
    assert model_hash(back) == model_hash(model) != model_hash(base)
    (in_file,) = yaml.load(tmp_path / "extended.yaml")["y"]["added"]
    assert in_file["name"] == name
    assert [*in_file["parameters"]] == [p.name for p in effect_type(name).form(kind).parameters]


def delay_of(value: object, unit: str = "s") -> dict[str, object]:
    return {"parameters": {"delay": {"value": value, "unit": unit}}}


BAD = [
    ({"name": "dely"}, r"added\[0\]: no effect is named 'dely'"),
    ({"kind": "slow"}, "effect delay has no kind 'slow'"),
    ({"parameters": {}}, "parameters: key 'delay' is missing; add it"),
    ({"parameters": {"delay_ms": 1e-2}}, "unknown key 'delay_ms'; did you mean 'delay'"),
    ({"parameters": {"delay": 1e-5}}, "delay = 1e-05 should be a value and a unit, as .* unit: s}"),
    ({"parameters": {"late": {"value": 1.0}}}, "unknown key 'late'"),
    ({"parameters": {"delay": {"value": 1.0}}}, "should be a value and a unit"),
    (delay_of(1e-5, "ms"), "delay: unit is 'ms', not 's': convert the value"),
    (delay_of(1), "delay = 1 should be a number with a point"),
    (delay_of(float("nan")), "delay = nan should be a number"),
    (delay_of(-1e-5), "delay = -1e-05 is out of range: from 0 to"),
]


@pytest.mark.parametrize(("change", "reason"), BAD)
def test_what_is_no_effect_is_refused(change: dict[str, object], reason: str) -> None:
    good = AddedEffect("delay", "", {"delay": {"value": 1e-5, "unit": "s"}})
    assert added_from([good], Scale()) == (Added("delay", "", (1e-5,)),)
    with pytest.raises(InputError, match=reason):
        added_from([evolve(good, **change)], Scale())


def test_two_effects_in_the_place_of_one_hysteresis_are_refused(tmp_path: Path) -> None:
    """The second would silently replace the first."""
    base, late = load_model(MODEL), Added("rate_dependent_hysteresis", "", (1e-3,))
    delay = Added("delay", "", (1e-5,))
    save_model(tmp_path / "model.yaml", evolve(base, y=evolve(base.y, added=(late, delay))), "")
    assert load_model(tmp_path / "model.yaml").y.added == (late, delay)
    twice = evolve(base, y=evolve(base.y, added=(late, delay, late)))
    save_model(tmp_path / "model.yaml", twice, "")
    reason = r"model\.yaml: y: added\[2\]: rate_dependent_hysteresis: .* replaced already: keep one"
    with pytest.raises(InputError, match=reason):
        load_model(tmp_path / "model.yaml")
