"""Picture of a table's curve: one column over another, a line or panel for each of a third's."""

from collections.abc import Callable, Sequence
from functools import partial
from math import ceil

from attrs import frozen
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.table import Cell, Columns, Row


@frozen
class TableCurve:
    """Columns that a table's picture shows: ``y`` over ``x``, a line for each value of ``by``.

    With ``panel``, a panel of the picture for each of that column's values.
    """

    x: str
    y: str
    by: str | None = None
    logarithmic: bool = False
    panel: str | None = None

    def picture(self, title: str, columns: Columns, rows: Sequence[Row]) -> Callable[[], Figure]:
        """Return what draws the picture of a table with this title, columns and rows."""
        return partial(curve_figure, self, title, columns, rows)


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
