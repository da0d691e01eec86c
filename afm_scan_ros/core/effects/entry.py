"""What a catalogue entry states: the physics of an effect, and how the chain is extended by it."""

from collections.abc import Callable, Iterable, Mapping

from attrs import field, frozen
from attrs.validators import in_

from afm_scan_ros.core.chain import Chain
from afm_scan_ros.core.effects.residual_features import ResidualFeatures
from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import Array

REMEDIES = ("feedforward", "partly", "none")


@frozen
class Parameter:
    """A parameter in SI units: where it may lie, and from what change on it matters.

    ``step`` is a small change of it, by which its influence is measured. One that is the record's
    ``own``, as a disturbance's phase, is another in every record.
    """

    name: str
    unit: str
    lower: float
    upper: float
    step: float
    own: bool = False

    def nearest(self, value: float) -> float:
        """Return the value within the bounds that is nearest to ``value``."""
        return min(max(float(value), self.lower), self.upper)


@frozen(eq=False)
class Form:
    """One form of an effect, as static or dynamic coupling; ``kind`` is empty where it has one.

    ``insert`` gives the chain with the effect at its parameters' values (p,). ``starts`` gives
    values from which to fit, some for each local minimum, from what is seen of the residual.
    With ``neutral`` values the effect is there and changes nothing. ``becomes`` is the name and
    kind of the simpler form that this one is to a record that tells not all of its parameters. One
    that ``refines`` another kind says the same more exactly or with fewer parameters: it is no
    candidate of its own, but may take the other's place once that was kept.
    """

    kind: str
    parameters: tuple[Parameter, ...]
    insert: Callable[[Chain, Array], Chain]
    starts: Callable[[ResidualFeatures], Iterable[tuple[float, ...]]]
    neutral: tuple[float, ...]
    refines: str | None = None
    becomes: tuple[str, str] | None = None


@frozen(eq=False)
class Entry:
    """An effect that the paper's model lacks.

    ``needs`` says what excitation it takes to see it, ``confusable`` names the entries it can be
    mistaken for, ``experiment`` the one that tells them apart. ``remedy`` is what feedforward can
    do about it, ``advice`` what is to be done where that is not all. ``words`` are of the kinds
    that have no name, or one that does not say where the effect is.
    """

    name: str
    equation: str
    needs: str
    confusable: tuple[str, ...]
    experiment: str
    remedy: str = field(validator=in_(REMEDIES))
    advice: str
    forms: tuple[Form, ...]
    words: Mapping[str, str] = field(factory=dict)

    def kind_words(self, kind: str) -> str:
        """Return what tells a form from the effect's others; nothing where it has but one."""
        return "" if len(self.forms) == 1 else self.words.get(kind, kind)

    def form(self, kind: str) -> Form:
        """Return the form of a kind; raises InputError where there is none."""
        for form in self.forms:
            if form.kind == kind:
                return form
        kinds = ", ".join(repr(form.kind) for form in self.forms)
        raise InputError(f"effect {self.name} has no kind {kind!r}: choose among {kinds}")

    def family(self, kind: str) -> tuple[Form, ...]:
        """Return the forms that may stand in each other's place, one of which is of ``kind``."""
        found = self.form(kind)
        root = found.kind if found.refines is None else found.refines
        return tuple(form for form in self.forms if root in (form.kind, form.refines))
