"""A chain's answer to one record, of which only those stages are played again that changed."""

from attrs import define, field

from afm_scan_ros.core.cascade import Cascade
from afm_scan_ros.core.chain import Chain, Stage
from afm_scan_ros.core.diagnosis.initial_state import DEPOLARISED, InitialState
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.types import Array

Kept = dict[int, tuple[tuple[object, ...], Array]]


@define(eq=False)
class Playback:
    """One axis of one record.

    A fit calls again and again with chains that differ in one place, and hysteresis and vibration
    are what takes time: so each stage keeps its last answer, and the parts that gave it.
    """

    view: AxisSignals
    initial_state: InitialState = DEPOLARISED
    _kept: Kept = field(factory=dict, init=False)

    def displacement(self, chain: Chain) -> Array:
        """Displacement (n,) in m that the chain makes of the record, the other axis' included."""
        chain = chain.of_record(self.view.number)
        period, signal, changed = self.view.sample_period, self.view.drive, False
        for number, stage in enumerate(chain.stages()):
            changed = changed or self._kept.get(number, ((), None))[0] != stage.parts
            if changed:
                cascade = Cascade(stage.make(period))
                begun = self.initial_state if number == 0 else DEPOLARISED
                met = self._with_other(signal, stage)
                self._kept[number] = stage.parts, begun.played(cascade, met)
            signal = self._kept[number][1]
        return signal

    def _with_other(self, signal: Array, stage: Stage) -> Array:
        """Signal (n,) with what the other axis adds before a stage."""
        for maker in stage.coupling:
            element = maker(self.view.sample_period)
            signal = signal + element.apply(element.at_rest(), self.view.other)[1]
        return signal
