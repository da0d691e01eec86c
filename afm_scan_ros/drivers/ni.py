"""The driver ``nidaqmx``: a converter of NI (National Instruments), or one at its gRPC server."""

import math
import time
from contextlib import ExitStack

import numpy as np
from nidaqmx.errors import DaqError, Error

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers.base import Driver, Reading
from afm_scan_ros.drivers.ni_tasks import RAN_EMPTY, Converter, Input, Output
from afm_scan_ros.drivers.settings import ScannerSettings, samples_in

UNDERRUN = (RAN_EMPTY, -200621, -200018, -200016)
"""Codes of NI-DAQmx for a sample that was not output in time."""
OVERRUN = (-200279, -200361, -200714)
"""Codes of NI-DAQmx for a sample that was not read in time."""
TARDY = 0.25
"""Seconds beyond its length that a chunk may take: less than the process allows, and the buffer."""
POLL = 0.01
"""Seconds between two looks at the progress of a ramp."""


class NiDaqmx(Driver):
    """Outputs and inputs on one sample clock, buffered, without regeneration.

    The channels are those of the axes. ``buffer_s`` (s) of drive, at rest at first, wait in the
    output buffer. They bridge delays of the software, and the readings come as much later.
    ``server`` is the address of an NI gRPC Device Server, as host:port; empty for a converter at
    this computer. ``terminals`` is NI's terminal configuration, as RSE. ``clock`` is the terminal
    of the output's sample clock, where that is not /DEVICE/ao/SampleClock.
    """

    RAMPS_WHILE_BLOCKED = True  # calls of NI-DAQmx to two tasks do not wait for each other

    def __init__(
        self,
        settings: ScannerSettings,
        buffer_s: float = 0.1,
        server: str = "",
        terminals: str = "DEFAULT",
        clock: str = "",
    ) -> None:
        if not 0.0 < buffer_s < math.inf:
            raise InputError(f"buffer_s = {buffer_s:g} should be above 0 and finite")
        self._converter = Converter(settings, server, terminals, clock)
        self._buffer = buffer_s
        self._running = self._ramping = False
        self._count = 0  # of samples read
        self._period: float
        self._chunk: int
        self._output: Output
        self._input: Input

    def buffered(self, sample_period: float) -> int:
        """Samples in the output buffer before the first of a scan."""
        return samples_in(self._buffer, sample_period)

    def start(self, sample_period: float) -> None:
        """Reserve the converter, and fill its buffer with rest; raises InputError as NI says."""
        self._period, self._chunk = sample_period, self.buffered(sample_period)
        rate = 1.0 / sample_period
        with ExitStack() as undo:
            undo.callback(self._converter.release)
            try:
                self._output = Output.reserved(self._converter, rate, 2 * self._chunk)
                self._input = Input.reserved(self._converter, rate, 4 * self._chunk)
                self._output.write(np.zeros((len(AXES), self._chunk)), TARDY)
            except Error as error:
                raise InputError(_words(error)) from error
            undo.pop_all()

    def advance(self, drive: Trace) -> Reading:
        """Output a block in chunks of the buffer, and return what was read meanwhile."""
        volts = np.stack([drive.x, drive.y])
        read = np.empty_like(volts)
        for first in range(0, drive.x.size, self._chunk):
            part = slice(first, first + self._chunk)
            try:
                read[:, part] = self._exchange(volts[:, part])
            except Error as error:
                raise ScanError(self._named(error)) from error
        return Reading(Trace(drive.first_sample, drive.sample_period, *read))

    def ramp_down(self) -> float:
        """Ramp down after what is in the buffer; where the output has failed, from where it is."""
        begun, self._ramping = time.monotonic(), True
        self._converter.release(self._input.task)
        if self._running:
            try:
                self._ramp_after_buffer()
            except (Error, TimeoutError):
                self._ramp_anew()
        self._converter.release()
        return time.monotonic() - begun

    def _exchange(self, volts: Array) -> Array:
        if self._ramping:  # another thread does, and this one has waited until now
            raise ScanError("the drive is ramped down")
        limit = volts.shape[1] * self._period + TARDY
        self._output.write(volts, limit)
        if not self._running:
            self._input.task.start()  # it waits for the output's clock
            self._output.task.start()
            self._running = True
        read = self._input.read(volts.shape[1], limit)
        self._count += read.shape[1]
        return read

    def _ramp_after_buffer(self) -> None:
        ramp = self._ramp(self._output.last())
        end = self._output.written + ramp.shape[1]
        limit = (2 * self._chunk + ramp.shape[1]) * self._period + TARDY
        deadline = time.monotonic() + limit
        volts = np.pad(ramp, ((0, 0), (0, self._chunk)))  # at rest until the task is stopped
        for first in range(0, volts.shape[1], self._chunk):
            self._output.write(volts[:, first : first + self._chunk], limit)
        while self._output.generated < end:
            if time.monotonic() > deadline:
                raise TimeoutError
            time.sleep(POLL)

    def _ramp_anew(self) -> None:
        ramp = self._ramp(self._output.standing(self._count))
        self._converter.release(self._output.task)
        volts = np.pad(ramp, ((0, 0), (0, 1)))  # a buffer has two samples at least
        limit = volts.shape[1] * self._period + TARDY
        self._converter.output_once(1.0 / self._period, volts, limit)

    def _ramp(self, before: dict[str, float]) -> Array:
        slew = self._converter.settings.amplifier.ramp_down_slew
        ramp = ramp_to_rest(0, self._period, before, slew)
        return np.stack([ramp.x, ramp.y])

    def _named(self, error: Error) -> str:
        """Name what went wrong; where the output stopped the clock, the input has only waited."""
        try:
            self._output.task.is_task_done()
        except Error as why:
            error = why
        code = error.error_code if isinstance(error, DaqError) else 0
        if code in UNDERRUN:
            return f"underrun: a sample was not output in time (NI-DAQmx {code}): raise buffer_s"
        if code in OVERRUN:
            return f"overrun: a sample was not read in time (NI-DAQmx {code}): raise buffer_s"
        return _words(error)


def _words(error: Error) -> str:
    return f"NI-DAQmx: {' '.join(str(error).split())}"
