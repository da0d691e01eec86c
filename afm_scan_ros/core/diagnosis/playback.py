"""Response of a chain to one record; only the stages that changed are evaluated again."""

from attrs import define, field

from afm_scan_ros.core.chain import Chain, Stage
from afm_scan_ros.core.diagnosis.initial_state import DEPOLARISED, InitialState
from afm_scan_ros.core.diagnosis.records import AxisSignals
from afm_scan_ros.core.types import Array

StageResponses = dict[int, tuple[Stage, Array]]


@define(eq=False)
class Playback:
    """One axis of one record.

    A fit evaluates many chains that differ in one place; hysteresis and vibration take most of the
    time. So the last response of each stage is cached with the stage, which compares by value.
    """

    view: AxisSignals
    initial_state: InitialState = DEPOLARISED
    _cache: StageResponses = field(factory=dict, init=False)

    def displacement(self, chain: Chain) -> Array:
        """Displacement (n,) in m that the chain predicts, with what the other axis adds."""
        chain = chain.of_record(self.view.number)
        period, signal, changed = self.view.sample_period, self.view.drive, False
        for number, stage in enumerate(chain.stages()):
            changed = changed or number not in self._cache or self._cache[number][0] != stage
            if changed:
                begun = self.initial_state if number == 0 else DEPOLARISED
                met = self._with_other(signal, stage)
                self._cache[number] = stage, begun.played(stage.at(period), met)
            signal = self._cache[number][1]
        return signal

    def _with_other(self, signal: Array, stage: Stage) -> Array:
        """Signal (n,) with what the other axis adds before a stage."""
        for element in stage.coupling:
            effect = element.at(self.view.sample_period)
            signal = signal + effect.apply(effect.at_rest(), self.view.other)[1]
        return signal
