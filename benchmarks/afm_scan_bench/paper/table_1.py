"""Table 1: how far creep models of rising order miss five minutes."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from afm_scan_bench.accuracy import table1
from afm_scan_bench.paper.section import Compared, Drawn, Section
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, ORANGE
from afm_scan_ros.report.table import Row

PAPERS_CHOICE = 3
TICKS = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)

TEXT = (
    "A step of the drive is held for five minutes, and creep models of one to five elements (Eq."
    " 1) are fitted to all of it; errors in sensor volts (Eqs. 2, 3). As in the paper, errors fall"
    " up to order three and no further: the simulated scanner's creep is the paper's Eq. 6, of"
    " that order. Ours end at the simulated sensor's noise of 2 nm (0.25 mV); the paper's end 26"
    " times higher, at what its sensor and its room left. Volts are compared at 8 µm/V, an"
    " assumption."
)


def section() -> Section:
    """Fit each order, as ``afm-scan bench table1`` does."""
    found = table1.measure()
    headings = [heading for heading, _ in found.columns.values()]
    rows = [
        [format(row[key], form) for key, (_, form) in found.columns.items()] for row in found.rows
    ]
    chosen = next(int(row["order"]) for row in found.rows if row["chosen"])
    best = found.rows[PAPERS_CHOICE - 1]
    return Section(
        name="table_1",
        title="Table 1: error of the predicted creep against model order",
        text=TEXT,
        compared=[
            Compared("order chosen", PAPERS_CHOICE, chosen, form="d"),
            Compared("sigma at order 3", 6.52, float(best["sigma_mv"]), "mV", ".2f"),
            Compared("largest error at order 3", 23.1, float(best["maximum_mv"]), "mV", ".1f"),
        ],
        pictures=[Drawn("orders", _orders(found.rows), "Errors against model order")],
        details=[headings, *rows],
        numbers={"rows": list(found.rows)},
    )


@styled
def _orders(rows: Sequence[Row]) -> Figure:
    """Draw both errors against the order, the paper's and ours."""
    figure = Figure(figsize=(6.4, 3.2), layout="constrained")
    for panel, key, name in zip(
        figure.subplots(1, 2), ("sigma_mv", "maximum_mv"), ("sigma", "largest error"), strict=True
    ):
        orders = [row["order"] for row in rows]
        for prefix, colour, label in (("paper_", ORANGE, "paper"), ("", BLUE, "ours")):
            values = [float(row[prefix + key]) for row in rows]
            panel.semilogy(orders, values, "o-", ms=4, color=colour, label=label)
        panel.set(xlabel="order", ylabel=f"{name} in mV of the sensor")
        panel.minorticks_off()
        panel.set_yticks(
            [tick for tick in TICKS if panel.get_ylim()[0] < tick < panel.get_ylim()[1]]
        )
        panel.yaxis.set_major_formatter("{x:g}")
        panel.legend()
    return figure
