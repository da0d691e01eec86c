"""The fit report as a page: what was fitted on what, and how well."""

import numpy as np

from afm_scan_ros.core.identification.identify import Identification
from afm_scan_ros.report import html
from afm_scan_ros.report.effect_status_text import intervals_text, status_text
from afm_scan_ros.report.fit_figures import (
    bode_figure,
    creep_figure,
    hysteresis_figure,
    model_discrepancy_figure,
)
from afm_scan_ros.report.fit_summary import (
    CREEP_ORDER,
    RECORDS,
    VIBRATION_ORDER,
    finding_text,
    inverse_text,
    operator_text,
)
from afm_scan_ros.report.table import Rows


def fit_page(found: Identification) -> str:
    """Return the fit report as a self-contained HTML page."""
    warned = {name: axis.warnings for name, axis in found.axes.items()}
    warned |= {name: axis.warnings for name, axis in found.together.items()}
    known = [
        (f"{axis}, {effect}", status_text(status), intervals_text(status))
        for axis in found.model.axes
        for effect, status in found.model.axis(axis).effects.each()
    ]
    return html.page(
        "identification.html",
        findings=[f"{name}: {finding_text(one)}" for name in warned for one in warned[name]],
        known=Rows(("", "known, and where it holds", "95 % intervals"), known),
        together=found.together,
        axes=found.axes,
        pictures=_pictures(found) if found.axes else {},
        records=RECORDS,
        creep_order=CREEP_ORDER,
        vibration_order=VIBRATION_ORDER,
        between=between,
        operator_text=operator_text,
        inverse_text=inverse_text,
    )


def _pictures(found: Identification) -> dict[str, object]:
    """Draw what the page shows of axes whose records were of one kind each."""
    bode = {
        name: html.png(
            bode_figure(a.response, a.report.vibration, a.sample_period, a.at_zero_amplitude)
        )
        for name, a in found.axes.items()
    }
    return {
        "creep": html.png(creep_figure(found)),
        "bode": bode,
        "hysteresis": html.png(hysteresis_figure(found)),
        "discrepancy": html.png(model_discrepancy_figure(found)),
    }


def between(value: float, interval: tuple[float, float], digits: int = 4) -> str:
    """Value and interval, an open end as a question mark."""
    low, high = (f"{end:.{digits}g}" if np.isfinite(end) else "?" for end in interval)
    return f"{value:.{digits}g} ({low} to {high})"
