"""Fig. 5: Bode plots, measured and modelled, of both axes."""

import numpy as np
from matplotlib.figure import Figure

from afm_scan_bench.accuracy.effective_input import without_creep
from afm_scan_bench.in_process import record
from afm_scan_bench.paper.section import Compared, Drawn, Section
from afm_scan_bench.scans import SEED, default_model, default_plant
from afm_scan_ros.core.effects.vibration import first_resonance, held
from afm_scan_ros.core.identification.drives.excitation import frequency_plan
from afm_scan_ros.core.identification.local_response import FrequencyResponse, local_response
from afm_scan_ros.core.model import AxisModel
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import AXES
from afm_scan_ros.report.fit_page import COHERENCE
from afm_scan_ros.report.paper import styled
from afm_scan_ros.report.picture import BLUE, LIGHT_BLUE

POINTS = 2000
TEXT = (
    "The response of the simulated scanner to a random-phase multisine, measured with hysteresis"
    " and creep at work and freed of both by the model in config/model.yaml, and that model's own"
    " response. The paper's model is of fourth order and follows the scanner past the first"
    " resonance and not beyond. So does this one: the simulated scanner has a further, narrow"
    " resonance near 1.4 kHz (x). The response includes the converter's hold and half-sample delay,"
    " as the model does."
)


def section() -> Section:
    """Measure the response of both axes, beside the model's."""
    seen = record(frequency_plan(), default_plant(), SEED)
    models = {axis: default_model().axis(axis) for axis in AXES}
    modes = {axis: first_resonance(model.vibration) for axis, model in models.items()}
    return Section(
        name="figure_5",
        title="Fig. 5: Bode plots, measured and model",
        text=TEXT,
        compared=[
            Compared(f"first resonance, {axis}", 454.0, mode.frequency, "Hz", ".1f")
            for axis, mode in modes.items()
        ],
        pictures=[
            Drawn(axis, _drawn(seen.axis(axis), model), f"Response of the {axis} axis")
            for axis, model in models.items()
        ],
        numbers={
            axis: {"resonance_hz": mode.frequency, "damping": mode.damping}
            for axis, mode in modes.items()
        },
    )


def _measured(seen: Record, model: AxisModel) -> FrequencyResponse:
    """Response (m/V) of a record of one axis to F = H(u), freed of creep."""
    drive, displacement = seen.signals(seen.axes[0])
    hysteresis = model.hysteresis.operator()
    effective = hysteresis.apply(hysteresis.at_rest(), drive)[1]
    rigid = without_creep(model, displacement, seen.sample_period)
    return local_response(drive, effective, rigid, seen.sample_period)


@styled
def _drawn(seen: Record, model: AxisModel) -> Figure:
    """Draw magnitude and phase over the band that is driven, measured where it is coherent."""
    measured = _measured(seen, model)
    frequency = np.geomspace(measured.frequency[0], measured.frequency[-1], POINTS)
    modelled = held(model.vibration, seen.sample_period).response(2.0 * np.pi * frequency)
    clear = measured.coherence > COHERENCE
    figure = Figure(figsize=(7.2, 4.8), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for hertz, response, form, colour in (
        (measured.frequency[clear], measured.response[clear], ".", LIGHT_BLUE),
        (frequency, modelled, "-", BLUE),
    ):
        above.loglog(hertz, 1e6 * np.abs(response), form, ms=4, color=colour)
        below.semilogx(hertz, np.degrees(np.unwrap(np.angle(response))), form, ms=4, color=colour)
    above.legend(["measured", "model"])
    above.set_ylabel("response in µm/V")
    below.set(xlabel="frequency in Hz", ylabel="phase in degrees")
    return figure
