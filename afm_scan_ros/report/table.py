"""A table of figures: printed on the terminal, drawn as a figure, and saved as JSON."""

import json
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Literal, TypeAlias

from attrs import frozen
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD, Box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable

from afm_scan_ros.files.paths import replacing, write_text
from afm_scan_ros.report.terminal import say, visible

Cell: TypeAlias = float | int | str
Row: TypeAlias = Mapping[str, Cell]
Columns: TypeAlias = Mapping[str, tuple[str, str]]

WIDEST_WORD = 24
"""Letters of a word that a narrow terminal does not break."""


@frozen
class Rows:
    """Rows of text below their headings, if they have any; the first column names the rows."""

    headings: Sequence[str]
    rows: Iterable[Sequence[str]]
    title: str = ""

    def show(self, box: Box | None = None, left: Container[int] = (0,)) -> None:
        """Print the rows on the terminal; columns not of ``left`` are aligned on the right.

        No text is markup, and no word of a cell is cut: a table may be wider than the terminal.
        """
        console = Console(markup=False, emoji=False, highlight=False)
        rows = [[visible(text) for text in row] for row in self.rows]
        heads = ["\n".join(map(visible, text.split("\n"))) for text in self.headings]
        shown = RichTable(box=box, show_edge=False, pad_edge=False, show_header=bool(heads))
        shown.padding = (0, 1 if box else 2, 0, 0)
        columns = zip(heads or [""] * max(map(len, rows), default=0), *rows, strict=True)
        for number, (head, *entries) in enumerate(columns):
            words = " ".join([head, *entries]).split()
            width = min(WIDEST_WORD, max(map(len, words), default=0))
            side: Literal["left", "right"] = "left" if number in left or not heads else "right"
            shown.add_column(head, justify=side, min_width=width, overflow="fold")
        for row in rows:
            shown.add_row(*row)
        if self.title:
            console.print(visible(self.title))
        least = Measurement.get(console, console.options, shown).minimum
        console.print(shown, width=max(console.width, least), crop=False)


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
        columns = self.columns.items()
        rows = [[format(row[key], form) for key, (_, form) in columns] for row in self.rows]
        return Rows([heading for _, (heading, _) in columns], rows, self.title)

    def show(self) -> None:
        """Print the table on the terminal."""
        words = {number for number, (_, form) in enumerate(self.columns.values()) if not form}
        self.text().show(SIMPLE_HEAD, words)
        say("")

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
