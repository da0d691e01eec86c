"""A table of figures: for people on the terminal and as a curve, for machines as JSON."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from attrs import frozen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Value: TypeAlias = float | int | str
Row: TypeAlias = Mapping[str, Value]
Columns: TypeAlias = Mapping[str, tuple[str, str]]

WIDEST_WORD = 24
"""Letters of a word that a narrow terminal does not break."""


@frozen
class Curve:
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
    curve: Curve | None = None
    picture: "Callable[[], Figure] | None" = None

    def show(self) -> None:
        """Print the table on the terminal."""
        from rich.box import SIMPLE_HEAD  # noqa: PLC0415 - slow to import, needed only here
        from rich.console import Console  # noqa: PLC0415 - the same
        from rich.measure import Measurement  # noqa: PLC0415 - the same
        from rich.table import Table as RichTable  # noqa: PLC0415 - the same

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
            from afm_scan_ros.report.curve_figure import curve_figure  # noqa: PLC0415 - slow to import

            drawn = curve_figure(self.curve, self.title, self.columns, self.rows)
            drawn.savefig(folder / f"{self.name}.png")
        if self.picture is not None:
            self.picture().savefig(folder / f"{self.name}.png")
