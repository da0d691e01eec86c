"""The catalogue of effects as a page of the documentation, made from their descriptions.

``python docs/effects_page.py FILE`` writes it.
"""

import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from afm_scan_ros.core.effects.effect_type import EffectParameter, EffectType
from afm_scan_ros.core.effects.registry import EFFECTS

FURTHER = re.compile("_([3-9]|[12][0-9])$")
"""Ends of the names of numbered parameters that stand in the row of the second."""
FEEDBACK = "feedback"
REMEDIES = {"feedforward": "removes it", "partly": "removes it in part", "none": "cannot remove it"}
INTRODUCTION = """\
# Effects

<!-- Written by `python docs/effects_page.py docs/reference/effects.md`. -->

Each effect is one file in `afm_scan_ros/core/effects/`. Hysteresis, vibration and creep are the
base model, which `afm-scan identify` identifies. The others extend it. `afm-scan diagnose` fits
them to a residual, and a model file lists those that were found on an axis:

```yaml
added:
- name: delay
  kind: ''
  parameters:
    delay: {value: 2.0e-05, unit: s}
```

The signal passes the places of the chain in this order:

    drive u → [drive] → hysteresis → F → vibration → creep
            → + [coupling] → [output] → displacement x

The `hysteresis` inverse includes the effects before the hysteresis, and the `vibration` inverse
those in the vibration. Any inverse includes those behind creep. The order of the list matters: an
effect acts on the model with all effects that are listed before it. A diagnosis tries the orders.

Bounds are those of a reference scanner: 4 V to either side, 22.09 µm at 4 V, and a first resonance
of 454 Hz. For another scanner lengths scale with the displacement at its largest drive, voltages
with that drive, and times with the period of its first resonance. Bounds and starting values of a
diagnosis scale so, and so does what the equations call a part of that displacement.

In the equations w is 2 pi `frequency`. In `hysteretic_stiffness` and `nonlinear_spring` it is the
angular frequency of the first resonance, whose damping is zeta. The first resonance is the one that
rises highest.

`afm-scan calibrate --experiment NAME --out DIR` drives an experiment. For the base model it is a
record of the calibration. At the neutral values of all its parameters an effect changes nothing.
Effects in the feedback of coupled axes are identified with their vibration: name them to
`afm_scan_ros.identify`. How to add an effect: [tutorial](../tutorials/adding_an_effect.md).
"""


COUPLED = """\
`static_nonlinearity`, above, acts there too. `parameter_shift` is another linear response there.
"""


def effects_page(effects: Sequence[EffectType] = EFFECTS) -> str:
    """Return the page in Markdown: the base model's effects, then the others."""
    base = [each for each in effects if not (each.forms or each.feedback)]
    further = [each for each in effects if each.forms]
    coupled = [each for each in effects if each.feedback and not each.forms]
    parts = [
        INTRODUCTION,
        _table(
            ("effect", "place", "confusable with", "experiment", "feedforward"),
            (_summary(each) for each in (*base, *further, *coupled)),
        ),
        "## Base model\n",
        *(_section(each) for each in base),
        "## Effects beyond the base model\n",
        *(_section(each) for each in further),
        "## Effects in the feedback of coupled axes\n",
        COUPLED,
        *(_section(each) for each in coupled),
    ]
    return "\n".join(parts)


def _summary(of: EffectType) -> tuple[str, ...]:
    places = dict.fromkeys(place for form in of.forms for place in form.places)
    return (
        f"[`{of.name}`](#{of.name})",
        ", ".join(places) or (FEEDBACK if of.feedback else of.name),
        ", ".join(of.confusable),
        of.experiment,
        REMEDIES[of.remedy],
    )


def _section(of: EffectType) -> str:
    heads = ("kind", "place", "parameter", "unit", "from", "to", "neutral")
    facts = (
        f"- Equation: `{of.equation}`",
        f"- Excitation: {of.needs}.",
        f"- Confusable with: {', '.join(of.confusable)}." if of.confusable else "",
        f"- Experiment: {of.experiment}.",
        f"- Feedforward {REMEDIES[of.remedy]}. {of.advice[0].upper()}{of.advice[1:]}.",
        f"- Inverse: {of.inverse}" if of.inverse else "",
        f"- Source: {of.source}",
    )
    return "\n".join(
        (
            f"### {of.name}\n",
            f"{of.physics.strip()}\n",
            *(fact for fact in facts if fact),
            "",
            _table(heads, _rows(of)),
        )
    )


def _rows(of: EffectType) -> Iterator[tuple[str, ...]]:
    for parameter in of.parameters:
        yield ("", of.name, f"`{parameter.name}`", *_numbers(parameter)[:3], "")
    if of.feedback:
        for parameter in _first(of.feedback.parameters):
            names = _names(of.feedback.parameters, parameter)
            yield ("", FEEDBACK, names, *_numbers(parameter)[:3], "")
    for form in of.forms:
        for parameter in _first(form.parameters):
            names = _names(form.parameters, parameter)
            yield (form.kind, " and ".join(form.places), names, *_numbers(parameter))


def _first(parameters: Sequence[EffectParameter]) -> Iterator[EffectParameter]:
    """Parameters but those that stand in the row of another."""
    return (each for each in parameters if not FURTHER.search(each.name))


def _names(parameters: Sequence[EffectParameter], parameter: EffectParameter) -> str:
    """Name of a parameter, and of those that are numbered after it."""
    if not parameter.name.endswith("_2"):
        return f"`{parameter.name}`"
    *_, last = (p.name for p in parameters if p.name.startswith(parameter.name[:-1]))
    return f"`{parameter.name}` to `{last}`"


def _numbers(of: EffectParameter) -> tuple[str, ...]:
    return of.unit, f"{of.lower:g}", f"{of.upper:g}", f"{of.neutral:g}"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = (heads, ["---"] * len(heads), *rows)
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(effects_page(), "utf-8")
