"""The fine steering mirror's frequency response, measured and modelled."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_scan_bench.measured.mirror.recordings import AMPLITUDES, identified, spectra
from afm_scan_bench.measured.mirror.response_matrix import ResponseMatrix, response_matrix
from afm_scan_ros.core.identification.state_space.model import StateSpaceModel
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, GREY, LIGHT_BLUE, LIGHT_ORANGE, ORANGE

MICRO = 1e6
COLOURS = dict(zip(AMPLITUDES, (LIGHT_BLUE, BLUE, ORANGE), strict=True))
CLOSE_UPS = (((1, 2), (895.0, 950.0)), ((0, 0), (960.0, 1040.0)))
"""Output and input, from zero, with the frequencies shown, in Hz."""
TITLE = "Fine steering mirror, measured by Floren et al., ISMA-USD 2024 (CC BY 4.0)"

ORDER = 28


def fitted(amplitude: int, left_out: int | None = None) -> StateSpaceModel:
    """Linear model of one amplitude, from all realisations but one."""
    chosen = () if left_out is None else (left_out,)
    return identified((amplitude,), chosen, states=ORDER).coupled.linear


@styled
def response_figure() -> Figure:
    """Show all responses at 200 mV, their noise, nonlinearity and model; two modes by amplitude."""
    figure = Figure(figsize=(9.6, 5.6), layout="constrained")
    figure.suptitle(TITLE, x=0.01, ha="left")
    grid = figure.add_gridspec(6, 4, width_ratios=(1.0, 1.0, 1.0, 1.4))
    measured = response_matrix(spectra(200))
    outputs, drives = 3, 3
    for output, drive in np.ndindex(outputs, drives):
        panel = figure.add_subplot(grid[2 * output : 2 * output + 2, drive])
        _whole(panel, measured, output, drive)
        panel.tick_params(labelbottom=output == outputs - 1, labelleft=drive == 0)
    figure.axes[3].set_ylabel("µm/V at 200 mV")
    figure.axes[7].set_xlabel("Hz")
    for row, (entry, band) in enumerate(CLOSE_UPS):
        _close_up(figure.add_subplot(grid[3 * row : 3 * row + 3, 3]), entry, band)
    figure.axes[10].set_xlabel("Hz")
    _legends(figure)
    return figure


def _legends(figure: Figure) -> None:
    """Put both legends below the panels, where they hide nothing."""
    parts, amplitudes = (figure.axes[i].get_legend_handles_labels() for i in (0, 9))
    figure.legend(*parts, loc="outside lower left", ncols=4)
    figure.legend(*amplitudes, loc="outside lower right", ncols=3)


def _whole(panel: Axes, measured: ResponseMatrix, output: int, drive: int) -> None:
    frequency = measured.omega / (2.0 * np.pi)
    model = np.abs(fitted(200).response(measured.omega)[:, output, drive])
    shown = (
        (np.abs(measured.response), GREY, 2.5, "measured"),
        (measured.nonlinear, LIGHT_ORANGE, 0.8, "nonlinear"),
        (measured.noise, LIGHT_BLUE, 0.8, "noise"),
    )
    for values, colour, width, name in shown:
        panel.plot(frequency, MICRO * values[:, output, drive], color=colour, lw=width, label=name)
    panel.plot(frequency, MICRO * model, color=BLUE, lw=0.7, label="28 states")
    panel.set(yscale="log", ylim=(1e-2, 3e2), xlim=(0.0, 3000.0))
    panel.set_title(f"input {drive + 1} to output {output + 1}", fontsize=8)


def _close_up(panel: Axes, entry: tuple[int, int], band: tuple[float, float]) -> None:
    output, drive = entry
    for amplitude, colour in COLOURS.items():
        measured = response_matrix(spectra(amplitude))
        frequency = measured.omega / (2.0 * np.pi)
        near = (frequency > band[0]) & (frequency < band[1])
        model = fitted(amplitude).response(measured.omega[near])[:, output, drive]
        dots = MICRO * np.abs(measured.response[near, output, drive])
        panel.plot(frequency[near], dots, ".", color=colour, ms=2.5)
        line = MICRO * np.abs(model)
        panel.plot(frequency[near], line, color=colour, label=f"{amplitude} mV rms")
    title = f"input {drive + 1} to output {output + 1}, µm/V (dots: measured)"
    panel.set_title(title, fontsize=8)
