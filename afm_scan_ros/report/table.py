"""A table of figures: printed on the terminal, drawn as a figure, and saved as JSON."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from attrs import frozen
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable
from rich.text import Text

from afm_scan_ros.files.paths import replacing, write_text
from afm_scan_ros.report.terminal import say, visible

Cell: TypeAlias = float | int | str
Row: TypeAlias = Mapping[str, Cell]
Columns: TypeAlias = Mapping[str, tuple[str, str]]

WIDEST_WORD = 24
"""Letters of a word that a narrow terminal does not break."""


def cell(text: str, style: str = "") -> Text:
    """Return text for a table or its title, in which brackets are no markup."""
    return Text(visible(text), style)


def _heading(text: str) -> Text:
    """Return the text above a column, which may have several lines."""
    return Text("\n".join(map(visible, text.split("\n"))))


@frozen
class Rows:
    """Rows of text below their headings, if they have any; the first column names the rows."""

    headings: Sequence[str]
    rows: Iterable[Sequence[str]]
    title: str = ""

    def show(self) -> None:
        """Print the rows on the terminal."""
        title = cell(self.title, "table.title") if self.title else None
        shown = RichTable(box=None, pad_edge=False, title=title, title_justify="left")
        for number, heading in enumerate(self.headings):
            shown.add_column(_heading(heading), justify="right" if number else "left")
        shown.show_header = bool(self.headings)
        for row in self.rows:
            shown.add_row(*map(cell, row))
        Console().print(shown)


@frozen
class Table:
    """Rows of figures; ``columns`` maps each key of a row to its heading and format.

    ``picture`` draws the table's picture.
    """

    name: str
    title: str
    columns: Columns
    rows: Sequence[Row]
    picture: Callable[[], Figure] | None = None

    def text(self) -> Rows:
        """Return the table as text."""
        headings = [heading for heading, _ in self.columns.values()]
        forms = {key: form for key, (_, form) in self.columns.items()}
        rows = [[format(row[key], form) for key, form in forms.items()] for row in self.rows]
        return Rows(headings, rows, self.title)

    def show(self) -> None:
        """Print the table on the terminal."""
        shown = RichTable(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        text = self.text()
        columns = zip(text.headings, *text.rows, strict=True)
        for (heading, *entries), (_, form) in zip(columns, self.columns.values(), strict=True):
            words = " ".join([heading, *entries]).split()
            width = min(WIDEST_WORD, max(len(word) for word in words))
            side: Literal["left", "right"] = "right" if form else "left"
            shown.add_column(_heading(heading), justify=side, min_width=width, overflow="fold")
        for row in text.rows:
            shown.add_row(*map(cell, row))
        console = Console()
        console.print(cell(self.title))
        least = Measurement.get(console, console.options, shown).minimum
        console.print(shown, width=max(console.width, least), crop=False)  # a number is never cut
        console.print()

    def save(self, folder: Path) -> None:
        """Write ``NAME.json`` and, where the table has a picture, ``NAME.png``."""
        document = {"title": self.title, "rows": self.rows}
        write_text(folder / f"{self.name}.json", json.dumps(document, indent=2) + "\n")
        if self.picture is not None:
            with replacing(folder / f"{self.name}.png") as beside:
                self.picture().savefig(beside)


Part: TypeAlias = str | Rows
"""A paragraph or a table of what is shown on the terminal and on a page."""


def show(parts: Iterable[Part]) -> None:
    """Print sentences, a line each, and tables."""
    for part in parts:
        if isinstance(part, Rows):
            part.show()
        else:
            say(part)
