"""The parameters of the simulated scanner, as in a plant file."""

from attrs import evolve, frozen
from attrs.validators import ge, gt, le

from afm_scan_ros.core.limits import AmplifierSpec
from afm_scan_ros.core.types import AXES
from afm_scan_ros.simulation.axis_spec import AxisSpec, quantity
from afm_scan_ros.simulation.mechanisms.base import Ageing, Mechanism


@frozen
class SensorSpec:
    """Displacement sensor: white noise, then ``bits`` over a span centred on zero. In m."""

    noise_rms: float = quantity(ge(0.0), suffix="_nm", scale=1e-9)
    span: float = quantity(gt(0.0), suffix="_um", scale=1e-6)
    bits: int = quantity(ge(1), le(32))

    @property
    def quantum(self) -> float:
        """Displacement between two neighbouring readings, m."""
        return float(self.span / 2**self.bits)


@frozen
class PlantSpec:
    """A whole scanner; ``sensor_sensitivity`` (m/V) turns the vibration's sensor volts into m.

    ``mechanisms`` are what the scanner has come to have besides, in the order in which they act.
    """

    amplifier: AmplifierSpec
    sensor: SensorSpec
    x: AxisSpec
    y: AxisSpec
    sensor_sensitivity: float = quantity(ge(1e-9), le(1e-3), suffix="_m_per_v")
    mechanisms: tuple[Mechanism, ...] = ()

    def older(self, by: float) -> "PlantSpec":
        """Return the scanner ``by`` s later: only mechanisms that age are others."""
        aged = (m.older(by) if isinstance(m, Ageing) else m for m in self.mechanisms)
        return evolve(self, mechanisms=tuple(aged))

    def axes(self) -> dict[str, AxisSpec]:
        """Return the axes by name, in the order in which a sample draws its noise."""
        return {name: getattr(self, name) for name in AXES}
