"""What is made of one table or figure of the paper: numbers in parallel, pictures, and why."""

from collections.abc import Mapping, Sequence
from typing import Any

from attrs import frozen
from matplotlib.figure import Figure


@frozen
class Compared:
    """One quantity, as the paper gives it and as it was found here."""

    quantity: str
    published: float | str
    ours: float
    unit: str = ""
    form: str = ".3g"

    def row(self) -> tuple[str, str, str]:
        """Return quantity, published value and ours as people read them."""
        published = (
            self.published if isinstance(self.published, str) else self._text(self.published)
        )
        return (self.quantity, published, self._text(self.ours))

    def _text(self, value: float) -> str:
        return f"{value:{self.form}} {self.unit}".strip()


@frozen(eq=False)
class Drawn:
    """A picture of a section: the end of its file's name, the figure, and what it shows."""

    name: str
    figure: Figure
    caption: str


@frozen(eq=False)
class Section:
    """One table or figure of the paper beside ours.

    ``name`` is that of its files; ``text`` states how it was made and where it differs from the
    paper's, and why. ``details`` is a table with its headings first, ``numbers`` what JSON holds.
    """

    name: str
    title: str
    text: str
    compared: Sequence[Compared]
    pictures: Sequence[Drawn]
    details: Sequence[Sequence[str]] = ()
    numbers: Mapping[str, Any] = {}
