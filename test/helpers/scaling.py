"""The same scanner and record in other units of length, voltage and time."""

import numpy as np
from attrs import evolve

from afm_scan_ros.core.effects.scale import Scale
from afm_scan_ros.core.model import AxisModel, EverettSurface, HysteresisModel, ModelDiscrepancy
from afm_scan_ros.core.record import Record
from afm_scan_ros.core.types import Array, Trace


def scaled_axis(axis: AxisModel, scale: Scale) -> AxisModel:
    """Model of a scanner that differs in scale alone."""
    stage, creep, hysteresis = axis.vibration, axis.creep, axis.hysteresis
    gain = scale.length / scale.voltage
    return evolve(
        axis,
        hysteresis=HysteresisModel(
            _surface(hysteresis.surface, scale.voltage),
            _surface(hysteresis.direct, scale.voltage),
            inverse=hysteresis.inverse,
        ),
        vibration=evolve(
            stage,
            numerator=tuple(gain * _slowed(stage.numerator, len(stage.denominator), scale.time)),
            denominator=tuple(_slowed(stage.denominator, len(stage.denominator), scale.time)),
            delay=scale.time * stage.delay,
        ),
        creep=evolve(creep, time_constants=scale.time * np.array(creep.time_constants)),
        model_discrepancy=axis.model_discrepancy and _known(axis.model_discrepancy, scale),
        known_elsewhere=tuple(_known(each, scale) for each in axis.known_elsewhere),
    )


def scaled_record(record: Record, scale: Scale) -> Record:
    """Record of a scanner that differs in scale alone."""
    spec = record.scan
    assert spec is not None
    lengths = ("range_x", "range_y", "preparation_lower", "preparation_upper")
    lengths += ("centre_x", "centre_y")
    times = ("approach", "settle", "y_step")
    rates = ("line_rate", "preparation_rate")
    changed = {name: scale.length * getattr(spec, name) for name in lengths}
    changed |= {name: scale.time * getattr(spec, name) for name in times}
    changed |= {name: getattr(spec, name) / scale.time for name in rates}
    return evolve(
        record,
        drive=scale.voltage * record.drive,
        displacement=scale.length * record.displacement,
        sample_period=scale.time * record.sample_period,
        scan=evolve(spec, **changed),
    )


def scaled_trace(trace: Trace, size: float, time: float) -> Trace:
    """Trace of other units."""
    return Trace(trace.first_sample, time * trace.sample_period, size * trace.x, size * trace.y)


def _slowed(polynomial: tuple[float, ...], count: int, time: float) -> Array:
    """Coefficients in powers of s of a response that takes ``time`` times as long."""
    powers = np.arange(len(polynomial))[::-1] - (count - 1)
    return np.array(polynomial) * time**powers


def _surface(surface: EverettSurface, size: float) -> EverettSurface:
    return EverettSurface(
        size * surface.lower,
        size * surface.upper,
        size * surface.values,
        size * surface.offset,
        None if surface.bias is None else size * surface.bias,
        None if surface.uneven is None else size * surface.uneven,
    )


def _known(known: ModelDiscrepancy, scale: Scale) -> ModelDiscrepancy:
    sizes = {
        name: tuple(scale.length * np.array(getattr(known, name)))
        for name in ("rms", "noise", "displacement")
    }
    return evolve(known, bands=tuple(np.array(known.bands) / scale.time), **sizes)
