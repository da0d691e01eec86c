"""The Bode plot shows what was measured, the model, and what the record knows of itself."""

from pathlib import Path

import numpy as np
from scipy import signal

from afm_scan_ros.core.identification.vibration.line_response import FrequencyResponse
from afm_scan_ros.core.identification.vibration.rational_fit import Order, fit_rational
from afm_scan_ros.report.fit_figures import bode_figure
from afm_scan_ros.report.scan_figures import save

PERIOD, GAIN = 1e-4, 5e-6
NAMES = (
    "measured",
    "model",
    "noise (sd)",
    "nonlinearity (sd)",
    "response to u, zero amplitude",
)


def response(scale: float) -> FrequencyResponse:
    omega = 2.0 * np.pi * np.arange(10.0, 800.0, 4.0)
    resonance = 2.0 * np.pi * 300.0
    continuous = [GAIN * resonance**2], [1.0, 0.04 * resonance, resonance**2]
    b, a, _ = signal.cont2discrete(continuous, PERIOD)
    found = scale * signal.freqz(b[0], a, omega * PERIOD)[1]
    size = np.abs(found)
    return FrequencyResponse(omega, found, 1e-4 * size, 1e-3 * size, np.full(len(omega), 0.999))


def test_measurement_model_and_their_doubts_are_drawn(tmp_path: Path) -> None:
    measured = response(1.0)
    fit = fit_rational(measured.up_to(700.0), PERIOD, GAIN, Order(2, 1))
    figure = bode_figure(measured, fit, PERIOD, at_rest=response(0.6))
    magnitude = figure.axes[0]
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in magnitude.get_lines()}
    assert set(NAMES) <= lines.keys()
    np.testing.assert_allclose(lines[NAMES[1]], lines[NAMES[0]], rtol=1e-3)
    np.testing.assert_allclose(lines[NAMES[2]], 1e-4 * lines[NAMES[0]], rtol=1e-6)
    assert any(f"resonance {fit.resonance:.3f} Hz" in each.get_text() for each in figure.texts)
    save(figure, tmp_path / "bode.png")
    assert (tmp_path / "bode.png").stat().st_size > 10_000
