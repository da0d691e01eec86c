"""A table of figures: for people on the terminal and as a curve, for machines as JSON."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Literal, TypeAlias

from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table as RichTable

from afm_scan_ros.report.style import styled

Cell: TypeAlias = float | int | str
Row: TypeAlias = Mapping[str, Cell]
Columns: TypeAlias = Mapping[str, tuple[str, str]]

WIDEST_WORD = 24
"""Letters of a word that a narrow terminal does not break."""


@frozen
class TableCurve:
    """Which columns make the table's picture: ``y`` over ``x``, a line for each ``by``.

    With ``panel``, a panel of the picture for each of that column's values.
    """

    x: str
    y: str
    by: str | None = None
    logarithmic: bool = False
    panel: str | None = None


@frozen
class Table:
    """Rows of figures; ``columns`` maps each key of a row to its heading and format.

    ``picture`` draws what a curve of the table's own columns cannot show.
    """

    name: str
    title: str
    columns: Columns
    rows: Sequence[Row]
    curve: TableCurve | None = None
    picture: Callable[[], Figure] | None = None

    def show(self) -> None:
        """Print the table on the terminal."""
        shown = RichTable(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
        for key, (heading, form) in self.columns.items():
            cells = [format(row[key], form) for row in self.rows]
            words = " ".join([heading, *cells]).split()
            width = min(WIDEST_WORD, max(len(word) for word in words))
            side: Literal["left", "right"] = "right" if form else "left"
            shown.add_column(heading, justify=side, min_width=width, overflow="fold")
        for row in self.rows:
            shown.add_row(*(format(row[key], form) for key, (_, form) in self.columns.items()))
        console = Console()
        console.print(self.title, highlight=False, markup=False)
        least = Measurement.get(console, console.options, shown).minimum
        console.print(shown, width=max(console.width, least), crop=False)  # a number is never cut
        console.print()

    def save(self, folder: Path) -> None:
        """Write ``NAME.json`` and, where the table has a curve or picture, ``NAME.png``."""
        folder.mkdir(parents=True, exist_ok=True)
        document = {"title": self.title, "rows": self.rows}
        (folder / f"{self.name}.json").write_text(json.dumps(document, indent=2) + "\n", "utf-8")
        if self.curve is not None:
            drawn = curve_figure(self.curve, self.title, self.columns, self.rows)
            drawn.savefig(folder / f"{self.name}.png")
        if self.picture is not None:
            self.picture().savefig(folder / f"{self.name}.png")


def show_rows(headings: Sequence[str], rows: Iterable[Sequence[str]], title: str = "") -> None:
    """Print rows of text as a table; the first column names the rows."""
    shown = RichTable(box=None, pad_edge=False, title=title or None, title_justify="left")
    for number, heading in enumerate(headings):
        shown.add_column(heading, justify="right" if number else "left")
    shown.show_header = bool(headings)
    for row in rows:
        shown.add_row(*row)
    Console().print(shown)


@styled
def curve_figure(curve: TableCurve, title: str, columns: Columns, rows: Sequence[Row]) -> Figure:
    """Draw the lines of a curve, its axes named as the table's columns are."""
    panels = _groups(rows, curve.panel)
    across, down = min(len(panels), 2), ceil(len(panels) / 2)
    figure = Figure(figsize=(6.4 * across, 4.0 * down), dpi=150, layout="constrained")
    figure.suptitle(title, x=0.01, ha="left")
    for i, (name, members) in enumerate(panels.items(), start=1):
        axes = figure.add_subplot(down, across, i)
        _lines(axes, curve, columns, members)
        axes.set_xlabel(str(name) if curve.panel else columns[curve.x][0])
    return figure


def _lines(axes: Axes, curve: TableCurve, columns: Columns, rows: Sequence[Row]) -> None:
    for group, members in _groups(rows, curve.by).items():
        x, y = [row[curve.x] for row in members], [row[curve.y] for row in members]
        name = format(group, columns[curve.by][1]) if curve.by else None
        axes.plot(x, y, "o-", markersize=3, label=name)
    axes.set_ylabel(columns[curve.y][0])
    axes.set_yscale("log" if curve.logarithmic else "linear")
    if curve.by:
        axes.legend(title=columns[curve.by][0])


def _groups(rows: Sequence[Row], column: str | None) -> dict[Cell, list[Row]]:
    """Rows by their value in a column, in order; all under one without a column."""
    groups: dict[Cell, list[Row]] = {}
    for row in rows:
        groups.setdefault(row[column] if column else "", []).append(row)
    return groups
