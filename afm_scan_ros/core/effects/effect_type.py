"""The description of a physical effect: its physics, its parameters, and its place in the chain.

Each effect is described once, in its own module, by a function decorated with ``register``.

In feedback, x[k+1] = A x[k] + B u[k] + E w[k], y[k] = C x[k] + D u[k] + F w[k] and
w = elements(u, y). The
structure's response to an added input is identified with the rest. So an element states the shape
of an effect and not its size. Source of the form: M. Schoukens and R. Toth, On the initialization
of nonlinear LFR model identification with the best linear approximation, 2020, arXiv:2004.05040.
"""

import math
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

import numpy as np
from attrs import Factory, cmp_using, evolve, field, frozen
from attrs.validators import deep_iterable, in_

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

_array = cmp_using(eq=np.array_equal)


@frozen
class Actuators:
    """Scales of a structure's m drives and p outputs.

    ``drive_scale`` (m,) is the rms of each drive (V) in the records. ``elongation`` (m, p), 1/m,
    gives of the outputs (m) the drives that would hold them at rest, each over its rms there.
    Vibrations last for ``decay_time`` (s) typically; ``sample_period`` is in s.
    """

    drive_scale: Array = field(eq=_array)
    elongation: Array = field(eq=_array)
    decay_time: float
    sample_period: float

    def scaled(self, drive: Array) -> Array:
        """Drives (n, m) over their scales."""
        return drive / self.drive_scale

    def elongations(self, output: Array) -> Array:
        """Elongations (n, m) of outputs (n, p), dimensionless."""
        return np.asarray(output @ self.elongation.T)


class FeedbackElement(Protocol):
    """An effect that adds inputs to a structure."""

    def added(self, drive: Array, output: Array, run: int) -> Array:
        """Inputs (n, added) of drive (n, m) in V and output (n, p) in m.

        All samples are a period in steady state; fewer, a ``run`` from rest, which zeros follow.
        """
        ...


PLACES = ("drive", "hysteresis", "vibration", "creep", "coupling", "output")
"""Places in the chain, in the signal's order: see chain.py."""
REMEDIES = ("feedforward", "partly", "none")
END, END_OF_HALF = 1e-3, 1e-2
"""Distance from an end of the range within which a value is at this end: the larger of a share of
the end and a share of half the interval."""
DECADES = 1e4
"""Ratio of its bounds from which on the size of a parameter is open."""


@frozen
class EffectParameter:
    """A parameter in SI units, with the bounds within which it is fitted on a reference scanner.

    With all parameters of a form at their ``neutral`` values the effect changes nothing. A
    parameter of which that is 0 is an amplitude. ``step`` is the change by which its influence is
    measured. One that is the record's ``own``, as a disturbance's phase, differs between records.
    An ``excited`` one is a frequency (Hz) that shows only where the drive moves the scanner. A
    ``located`` one is a spectral line of the residual, anywhere that a record shows one.
    """

    name: str
    unit: str
    lower: float
    upper: float
    step: float = Factory(lambda self: 1e-6 * (self.upper - self.lower), takes_self=True)
    neutral: float = 0.0
    own: bool = False
    excited: bool = False
    located: bool = False

    @property
    def spans_decades(self) -> bool:
        """Whether the size of the parameter is open, so that its changes are relative."""
        return self.lower > 0.0 and self.upper > DECADES * self.lower and not self.located

    def at(self, scale: Scale) -> "EffectParameter":
        """Return the parameter of a scanner of another scale."""
        size = scale.factor(self.unit)
        return evolve(
            self,
            lower=size * self.lower,
            upper=size * self.upper,
            step=size * self.step,
            neutral=size * self.neutral,
        )

    def nearest(self, value: float) -> float:
        """Return the value within the bounds that is nearest to ``value``."""
        return min(max(float(value), self.lower), self.upper)

    def at_end(self, value: float, halfwidth: float) -> bool:
        """Whether a value of an interval is at an end of the range: not determined by records."""
        half = halfwidth if math.isfinite(halfwidth) else 0.0
        ends = self.lower, self.upper
        return any(abs(value - e) <= max(END * abs(e), END_OF_HALF * half) for e in ends)


Starts = Callable[[ResidualFeatures], Iterable[tuple[float, ...]]]


def fixed(*values: tuple[float, ...]) -> Starts:
    """Return starts that are the same whatever the residual is."""
    return lambda _: values


@frozen(eq=False)
class EffectForm:
    """One form of an effect, as static or dynamic coupling; ``kind`` is empty for the main one.

    ``insert`` gives the chain with the effect at its parameters' values (p,). It changes the
    ``places`` of the chain that are named and no other. ``starts`` gives values from which to fit,
    some for each local minimum, from the features of the residual; by default the neutral ones, as
    suits parameters that act all but linearly. ``example`` has values of a size that a scanner may
    show, at which every form is tested.

    ``text`` labels the form among the effect's forms. A form that ``refines`` another kind states
    the same more exactly or with fewer parameters: it is fitted once the other is likely.
    """

    kind: str
    places: tuple[str, ...] = field(validator=deep_iterable(in_(PLACES)))
    parameters: tuple[EffectParameter, ...]
    insert: Callable[[Chain, Array], Chain]
    starts: Starts = Factory(lambda self: fixed(self.neutral), takes_self=True)
    example: tuple[float, ...] = field(kw_only=True)
    text: str = ""
    refines: str | None = None

    def at(self, scale: Scale) -> "EffectForm":
        """Return the form for a scanner of another scale: parameters and starts are its own."""
        sizes = [scale.factor(parameter.unit) for parameter in self.parameters]

        def starts(features: ResidualFeatures) -> Iterator[tuple[float, ...]]:
            """Starts of the reference scanner, scaled."""
            for start in self.starts(features.at(scale)):
                yield tuple(size * value for size, value in zip(sizes, start, strict=True))

        parameters = tuple(parameter.at(scale) for parameter in self.parameters)
        return evolve(self, parameters=parameters, starts=starts)

    @property
    def repeatable(self) -> bool:
        """Whether a scanner may have several of it, each at a frequency of its own."""
        return any(parameter.excited or parameter.located for parameter in self.parameters)

    @property
    def neutral(self) -> tuple[float, ...]:
        """Values with which the effect changes nothing."""
        return tuple(parameter.neutral for parameter in self.parameters)


@frozen(eq=False)
class FeedbackForm:
    """How an effect acts in the feedback of a coupled structure.

    ``elements`` makes its elements of the structure's actuators and the parameters' values (p,).
    The size of the effect follows from the structure's response, so ``values`` chooses them for
    actuators, before the fit. An effect that is ``linear`` adds nothing: the structure is another
    one, at all amplitudes.
    """

    parameters: tuple[EffectParameter, ...]
    values: Callable[[Actuators], tuple[float, ...]]
    elements: Callable[[Actuators, tuple[float, ...]], tuple[FeedbackElement, ...]]
    linear: bool = False


LINEAR = FeedbackForm((), lambda _: (), lambda _, __: (), linear=True)
"""Of an effect that changes a coupled structure's linear response, and no more."""


@frozen(eq=False)
class EffectType:
    """A physical effect.

    ``needs`` is the excitation by which it is identified. ``experiment`` distinguishes it from the
    effects it is ``confusable`` with. One of each such pair declares it; the registry adds the
    other direction. ``remedy`` is what feedforward can do, ``advice`` states other measures, and
    ``inverse`` how it is inverted and at what cost. ``source`` is the literature. ``physics``
    states equation, units, cause and assumptions.

    An effect of the base model has no ``forms``: it is identified from calibration records, and
    its ``parameters`` are those of the model file. ``feedback`` is the form of an effect that a
    coupled structure may have.
    """

    name: str
    equation: str
    needs: str
    experiment: str
    remedy: str = field(validator=in_(REMEDIES))
    advice: str
    source: str
    inverse: str = ""
    confusable: tuple[str, ...] = ()
    forms: tuple[EffectForm, ...] = ()
    parameters: tuple[EffectParameter, ...] = ()
    feedback: FeedbackForm | None = None
    physics: str = ""

    def at(self, scale: Scale) -> "EffectType":
        """Return the effect with the forms of a scanner of another scale."""
        return evolve(self, forms=tuple(form.at(scale) for form in self.forms))

    def kind_label(self, kind: str) -> str:
        """Return the label of a form among the effect's forms; empty where it has one form."""
        return "" if len(self.forms) == 1 else self.form(kind).text or kind

    def form(self, kind: str) -> EffectForm:
        """Return the form of a kind; raises InputError where there is none."""
        for form in self.forms:
            if form.kind == kind:
                return form
        kinds = ", ".join(repr(form.kind) for form in self.forms)
        raise InputError(f"effect {self.name} has no kind {kind!r}: choose among {kinds}")


REGISTERED: dict[str, EffectType] = {}
"""Effects by their names, as their modules declare them: read them from registry.py."""


def register(describe: Callable[[], EffectType]) -> Callable[[], EffectType]:
    """Register the effect that a function describes, with its module's docstring as ``physics``.

    Raises InputError where another effect has the name.
    """
    found = describe()
    if found.name in REGISTERED:
        raise InputError(f"two effects are named {found.name!r}: rename one")
    physics = found.physics or sys.modules[describe.__module__].__doc__ or ""
    REGISTERED[found.name] = evolve(found, physics=physics)
    return describe
