"""The driver ``nidaqmx``: a converter of NI (National Instruments), or one at its gRPC server."""

import math
import time
from contextlib import ExitStack, suppress
from importlib import import_module
from typing import Any

import nidaqmx
import numpy as np
from attrs import define
from nidaqmx.constants import AcquisitionType, RegenerationMode, TaskMode, TerminalConfiguration
from nidaqmx.errors import DaqError, Error
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.stream_writers import AnalogMultiChannelWriter

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.core.limits import ramp_to_rest
from afm_scan_ros.core.types import AXES, Array, Trace
from afm_scan_ros.drivers import Driver, Reading, ScannerSettings, samples_in

RAN_EMPTY = -200290
"""Code of NI-DAQmx for an output that stopped at its last sample, not to repeat old ones."""


class NiTasks:
    """Where the scanner is connected, and the tasks made there.

    ``server`` and ``clock`` are empty for the usual ones. Raises InputError for a channel that is
    missing, and for unknown ``terminals``.
    """

    def __init__(self, settings: ScannerSettings, server: str, terminals: str, clock: str) -> None:
        for name, axis in zip(AXES, (settings.x, settings.y), strict=True):
            for key, example in (("output_channel", "Dev1/ao0"), ("input_channel", "Dev1/ai0")):
                if not getattr(axis, key):
                    raise InputError(f"{name}: {key} is missing: give it, as {example}")
        if terminals not in TerminalConfiguration.__members__:
            known = ", ".join(TerminalConfiguration.__members__)
            raise InputError(f"terminals = {terminals} is unknown: give one of {known}")
        self.settings, self.terminals = settings, TerminalConfiguration[terminals]
        device = settings.x.output_channel.strip("/").partition("/")[0]
        self.clock = clock or f"/{device}/ao/SampleClock"
        self._channel = _channel_to(server) if server else None
        self._tasks: list[nidaqmx.Task] = []

    def task(self) -> nidaqmx.Task:
        """Make an empty task, at the server if there is one."""
        there = self._channel and nidaqmx.GrpcSessionOptions(self._channel, "")
        self._tasks.append(nidaqmx.Task(grpc_options=there))
        return self._tasks[-1]

    def release(self, *tasks: nidaqmx.Task) -> None:
        """End tasks, all by default; the outputs then stay where they are."""
        for task in tasks or (*self._tasks,):
            self._tasks.remove(task)
            with suppress(Error):  # that of a task that has failed, which is ended all the same
                task.close()

    def output_task(self, rate: float, mode: AcquisitionType, samples: int) -> nidaqmx.Task:
        """Make a task of both outputs at a rate (Hz), with a buffer of as many samples.

        Raises InputError where the device has another rate.
        """
        task, limit = self.task(), self.settings.amplifier.voltage_limit
        for axis in (self.settings.x, self.settings.y):
            task.ao_channels.add_ao_voltage_chan(axis.output_channel, min_val=-limit, max_val=limit)
        task.timing.cfg_samp_clk_timing(rate, sample_mode=mode, samps_per_chan=samples)
        if not math.isclose(rate, actual := task.timing.samp_clk_rate, rel_tol=1e-9):
            raise InputError(
                f"the converter samples at {actual:.9g} Hz, not at {rate:.9g} Hz: give a sample"
                " rate that its clock can be divided to"
            )
        task.out_stream.output_buf_size = samples
        return task

    def output_once(self, rate: float, volts: Array, timeout: float) -> None:
        """Output samples (V), (2, n), by a task of its own, and wait for the last (s)."""
        task = self.output_task(rate, AcquisitionType.FINITE, volts.shape[1])
        _writer(task).write_many_sample(volts)
        task.start()
        task.wait_until_done(timeout)


@define(eq=False)
class Output:
    """Both outputs, continuous and without regeneration.

    ``written`` counts samples. The last of them are kept, for as many as the buffer holds.
    """

    task: nidaqmx.Task
    written: int
    _recent: Array
    _writer: AnalogMultiChannelWriter

    @classmethod
    def reserved(cls, converter: NiTasks, rate: float, samples: int) -> "Output":
        """Reserve the outputs, at rest."""
        task = converter.output_task(rate, AcquisitionType.CONTINUOUS, samples)
        task.out_stream.regen_mode = RegenerationMode.DONT_ALLOW_REGENERATION
        task.control(TaskMode.TASK_COMMIT)
        return cls(task, 0, np.zeros((len(AXES), samples)), _writer(task))

    def write(self, volts: Array, timeout: float) -> None:
        """Append samples (V), (2, n), to the buffer, within a time (s) where it is full."""
        self._writer.write_many_sample(np.ascontiguousarray(volts), timeout)
        self.written += volts.shape[1]
        kept = self._recent.shape[1]
        self._recent = np.concatenate([self._recent, volts], axis=1)[:, -kept:]

    @property
    def generated(self) -> int:
        """Samples that were output."""
        return int(self.task.out_stream.total_samp_per_chan_generated)

    def standing(self, read: int) -> dict[str, float]:
        """Outputs (V) of a task that has failed, when ``read`` samples were read.

        Those that ran out of samples stand at the last, others where the readings end at least.
        """
        try:
            generated = self.generated
        except DaqError as error:
            generated = self.written if error.error_code == RAN_EMPTY else read
        place = self._recent.shape[1] - 1 - (self.written - generated)
        return dict(zip(AXES, self._recent[:, max(0, place)].tolist(), strict=True))

    def last(self) -> dict[str, float]:
        """Outputs (V) once the buffer is empty."""
        return dict(zip(AXES, self._recent[:, -1].tolist(), strict=True))


@define(eq=False)
class Input:
    """Both inputs, a sample at each update of the outputs."""

    task: nidaqmx.Task
    _reader: AnalogMultiChannelReader

    @classmethod
    def reserved(cls, converter: NiTasks, rate: float, samples: int) -> "Input":
        """Reserve the inputs, with a buffer of as many samples."""
        task = converter.task()
        for axis in (converter.settings.x, converter.settings.y):
            task.ai_channels.add_ai_voltage_chan(
                axis.input_channel,
                terminal_config=converter.terminals,
                min_val=axis.sensor_low,
                max_val=axis.sensor_high,
            )
        continuous = AcquisitionType.CONTINUOUS
        task.timing.cfg_samp_clk_timing(rate, converter.clock, sample_mode=continuous)
        task.in_stream.input_buf_size = samples
        task.control(TaskMode.TASK_COMMIT)
        reader = AnalogMultiChannelReader(task.in_stream)
        reader.verify_array_shape = False
        return cls(task, reader)

    def read(self, count: int, timeout: float) -> Array:
        """Return the next samples (V), (2, count), within a time (s)."""
        read = np.empty((len(AXES), count))
        self._reader.read_many_sample(read, count, timeout)
        return read


def _writer(task: nidaqmx.Task) -> AnalogMultiChannelWriter:
    writer = AnalogMultiChannelWriter(task.out_stream, auto_start=False)
    writer.verify_array_shape = False  # it would ask the server for the channels, each time
    return writer


def _channel_to(server: str) -> Any:  # noqa: ANN401 - grpc has no types
    try:
        whole = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
        return import_module("grpc").insecure_channel(server, options=whole)
    except ImportError as error:
        raise InputError(f"server = {server}: {error}: install nidaqmx[grpc]") from error


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
        self._converter = NiTasks(settings, server, terminals, clock)
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
