"""The catalogue of effects as a page of the documentation, made from their descriptions.

``python docs/effects_page.py FILE`` writes it.
"""

import re
import sys
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path

from afm_scan_ros.core.effects.effect_type import EffectParameter, EffectType
from afm_scan_ros.core.effects.registry import EFFECTS

FURTHER = re.compile("_([3-9]|[12][0-9])$")
"""Ends of the names of numbered parameters, which are stated with the second."""
SENTENCE = re.compile(r"(?<=[a-z0-9)])\. (?=[A-Z`])")
FEEDBACK = "feedback"
REMEDIES = {
    "feedforward": "",
    "partly": "Feedforward removes it in part. ",
    "none": "Feedforward cannot remove it. ",
}
PAPER = "D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123 (2001) 35"
"""What the sources of the base model begin with."""
INTRODUCTION = """\
# Effects

<!-- Written by `python docs/effects_page.py docs/reference/effects.md`. -->

Look an effect up here when a diagnosis names it, or to add it to a model yourself. Creep,
hysteresis and vibration form the base model; the others extend it, and a model file lists those
of an axis. Feedforward by the inverse removes an effect unless stated otherwise. The paper
that is named most is D. Croft, G. Shed and S. Devasia, J. Dyn. Syst. Meas. Control 123 (2001) 35.

```yaml
added:
- name: delay
  kind: ''
  parameters:
    delay: {value: 2.0e-05, unit: s}
```

The signal passes the places of the chain in this order. Each effect acts on the model with all
that are listed before it; a diagnosis tries the orders.

    drive u → [drive] → hysteresis → F → vibration → creep
            → + [coupling] → [output] → displacement x

Bounds are those of a reference scanner: 4 V to either side, 22.09 µm at 4 V, first resonance (the
highest peak) 454 Hz. Lengths scale with the displacement at the largest drive, voltages with that
drive, times with the period of the first resonance; a parameter without bounds has those stated
above it. An effect whose amounts are 0 and whose factors
are 1 changes nothing.

In the equations x0 is the displacement without the effect, y0 that of the other axis, G(s) the
vibration, and w is 2 pi `frequency`; in `hysteretic_stiffness` and `nonlinear_spring` w and zeta
are those of the first resonance. `afm_scan_ros/core/effects/NAME.py` derives each equation and its
inverse, with their assumptions. `afm-scan calibrate --experiment NAME --out DIR` drives an
experiment. [Adding an effect](../tutorials/adding_an_effect.md) takes one new file.
"""


COUPLED = """\
These effects are identified with the vibration of coupled axes: name them to
`afm_scan_ros.identify`. `static_nonlinearity`, above, acts there too, and `parameter_shift` stands
for another linear response.
"""


def effects_page(effects: Sequence[EffectType] = EFFECTS) -> str:
    """Return the page in Markdown: the base model's effects, then the others."""
    base = [each for each in effects if not (each.forms or each.feedback)]
    further = [each for each in effects if each.forms]
    coupled = [each for each in effects if each.feedback and not each.forms]
    parts = [
        INTRODUCTION,
        "## Base model\n",
        *(_section(each) for each in base),
        "## Effects beyond the base model\n",
        *(_section(each) for each in further),
        "## Effects in the feedback of coupled axes\n",
        COUPLED,
        *(_section(each) for each in coupled),
    ]
    return "\n".join(parts)


def _section(of: EffectType) -> str:
    facts = (
        f"- Equation: `{of.equation}`",
        f"- Excitation: {of.needs}. Experiment: {of.experiment}.",
        f"- Confusable with: {', '.join(of.confusable)}." if of.confusable else "",
        f"- {REMEDIES[of.remedy]}{of.advice[0].upper()}{of.advice[1:]}.",
        f"- Inverse: {_sentence(of.inverse)}" if of.inverse else "",
        f"- Source: {of.source.replace(PAPER, 'Croft, Shed and Devasia (2001)')}",
    )
    given = (f"- {of_form}." for of_form in _parameters(of))
    whole = (f"### {of.name}\n", f"{_sentence(of.physics)}\n", *filter(None, facts), *given, "")
    return "\n".join(whole)


def _sentence(text: str) -> str:
    """First sentence of a text."""
    first, *more = SENTENCE.split(text.strip().partition("\n\n")[0])
    return f"{first}." if more else first


def _parameters(of: EffectType) -> Iterator[str]:
    """Form, place and parameters of each form, bounds where they were not stated before."""
    seen: set[str] = set()
    if of.parameters:
        yield f"Parameters: {_bounds(of.parameters, seen)}"
    if of.feedback and of.feedback.parameters:
        yield f"Parameters: {_bounds(of.feedback.parameters, seen)}"
    for form in of.forms:
        kind = f"Form `{form.kind}`" if form.kind else "Parameters"
        yield f"{kind} ({' and '.join(form.places)}): {_bounds(form.parameters, seen)}"


def _bounds(parameters: Sequence[EffectParameter], seen: set[str]) -> str:
    found = []
    for each in _first(parameters):
        names = _names(parameters, each)
        whole = f"{names} ({_numbers(each)})"
        found.append(names if whole in seen else whole)
        seen.add(whole)
    return ", ".join(found)


def _first(parameters: Sequence[EffectParameter]) -> Iterator[EffectParameter]:
    """Parameters but those that are stated with another."""
    return (each for each in parameters if not FURTHER.search(each.name))


def _names(parameters: Sequence[EffectParameter], parameter: EffectParameter) -> str:
    """Name of a parameter, and of those that are numbered after it."""
    if not parameter.name.endswith("_2"):
        return f"`{parameter.name}`"
    *_, last = (p.name for p in parameters if p.name.startswith(parameter.name[:-1]))
    return f"`{parameter.name}` to `{last}`"


def _numbers(of: EffectParameter) -> str:
    unit = of.unit if of.unit != "1" or not isfinite(of.upper) else ""
    bounds = f"{of.lower:g} to {of.upper:g}" if isfinite(of.upper) else ""
    return f"{bounds} {unit}".strip()


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(effects_page(), "utf-8")
