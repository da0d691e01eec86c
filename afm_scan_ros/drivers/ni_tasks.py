"""The tasks of NI-DAQmx that the driver ``nidaqmx`` uses: outputs and inputs on one clock."""

import math
from contextlib import suppress
from importlib import import_module
from typing import Any

import nidaqmx
import numpy as np
from attrs import define
from nidaqmx.constants import AcquisitionType, RegenerationMode, TaskMode, TerminalConfiguration
from nidaqmx.errors import DaqError, Error
from nidaqmx.stream_readers import AnalogMultiChannelReader
from nidaqmx.stream_writers import AnalogMultiChannelWriter

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.core.types import AXES, Array
from afm_scan_ros.drivers.settings import ScannerSettings

RAN_EMPTY = -200290
"""Code of NI-DAQmx for an output that stopped at its last sample, not to repeat old ones."""


class Converter:
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
    def reserved(cls, converter: Converter, rate: float, samples: int) -> "Output":
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
    def reserved(cls, converter: Converter, rate: float, samples: int) -> "Input":
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
