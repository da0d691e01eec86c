"""A gRPC server that speaks NI's protocol, as far as the driver ``nidaqmx`` asks, for a twin."""

import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from pathlib import Path
from typing import Any

import click
import grpc
import numpy as np
from nidaqmx._stubs import nidaqmx_pb2 as ni
from nidaqmx._stubs.nidaqmx_pb2_grpc import NiDAQmxServicer, add_NiDAQmxServicer_to_server

from afm_scan_ros.core.types import Trace
from afm_scan_ros.files import share_directory
from afm_scan_ros.files.plant_file import load_plant
from afm_scan_ros.simulation.scanner import Piezoscanner
from helpers.ni_device import UNKNOWN_DEVICE, Device, NiError

FINITE, NO_REGENERATION = 10178, 10158
RATE, GENERATED, OUTPUT_BUFFER, REGENERATION = 0x1344, 0x192B, 0x186D, 0x1453
CLOCK = "/Dev1/ao/SampleClock"
CHANNELS = {"Dev1/ao0", "Dev1/ao1", "Dev1/ai0", "Dev1/ai1"}
RATES = 100e6
"""Hz: a sample clock is this divided by a whole number."""

Rpc = Callable[[Any, Any, grpc.ServicerContext], Any]


def rpc(call: Rpc) -> Rpc:
    """Give an error as NI's server does: by its code in the trailing metadata."""

    @wraps(call)
    def answered(self: Any, request: Any, context: grpc.ServicerContext) -> Any:
        try:
            return call(self, request, context)
        except NiError as error:
            counts = (("ni-samps-per-chan-read", "0"), ("ni-samps-per-chan-written", "0"))
            own = counts[:1] if "Read" in call.__name__ else counts[1:] * ("Write" in call.__name__)
            context.set_trailing_metadata((("ni-error", str(error.code)), *own))
            context.abort(grpc.StatusCode.UNKNOWN, str(error))

    return answered


class Server(NiDAQmxServicer):
    """A server of one device, Dev1."""

    def __init__(self, device: Device) -> None:
        self._device = device
        self._outputs: set[str] = set()

    @rpc
    def CreateTask(self, _request: Any, _: object) -> Any:
        self._made = getattr(self, "_made", 0) + 1
        return ni.CreateTaskResponse(
            task={"name": f"task{self._made}"}, new_session_initialized=True
        )

    @rpc
    def GetTaskAttributeString(self, request: Any, _: object) -> Any:
        return ni.GetTaskAttributeStringResponse(value=request.task.name)

    @rpc
    def CreateAOVoltageChan(self, request: Any, _: object) -> Any:
        self._refuse_unknown(request.physical_channel)
        self._outputs.add(request.task.name)
        return ni.CreateAOVoltageChanResponse()

    @rpc
    def CreateAIVoltageChan(self, request: Any, _: object) -> Any:
        self._refuse_unknown(request.physical_channel)
        return ni.CreateAIVoltageChanResponse()

    @rpc
    def CfgSampClkTiming(self, request: Any, _: object) -> Any:
        if request.task.name in self._outputs:
            rate = RATES / round(RATES / request.rate)
            self._rate = request.rate if abs(rate / request.rate - 1.0) < 1e-12 else rate
            self._device.configure(self._rate, finite=request.sample_mode_raw == FINITE)
        else:
            assert request.source == CLOCK
        return ni.CfgSampClkTimingResponse()

    @rpc
    def GetTimingAttributeDouble(self, request: Any, _: object) -> Any:
        assert request.attribute_raw == RATE
        return ni.GetTimingAttributeDoubleResponse(value=self._rate)

    @rpc
    def SetBufferAttributeUInt32(self, request: Any, _: object) -> Any:
        if request.attribute_raw == OUTPUT_BUFFER:
            self._device.buffer = request.value
        return ni.SetBufferAttributeUInt32Response()

    @rpc
    def SetWriteAttributeInt32(self, request: Any, _: object) -> Any:
        assert (request.attribute_raw, request.value_raw) == (REGENERATION, NO_REGENERATION)
        return ni.SetWriteAttributeInt32Response()

    @rpc
    def TaskControl(self, _request: Any, _: object) -> Any:
        return ni.TaskControlResponse()

    @rpc
    def StartTask(self, request: Any, _: object) -> Any:
        if request.task.name in self._outputs:
            self._device.run()
        return ni.StartTaskResponse()

    @rpc
    def WriteAnalogF64(self, request: Any, _: object) -> Any:
        volts = np.array(request.write_array).reshape(2, -1)
        self._device.write(volts, request.timeout)
        return ni.WriteAnalogF64Response(samps_per_chan_written=volts.shape[1])

    @rpc
    def ReadAnalogF64(self, request: Any, _: object) -> Any:
        read = self._device.read(request.num_samps_per_chan, request.timeout)
        return ni.ReadAnalogF64Response(read_array=read.ravel(), samps_per_chan_read=read.shape[1])

    @rpc
    def GetWriteAttributeUInt64(self, request: Any, _: object) -> Any:
        assert request.attribute_raw == GENERATED
        return ni.GetWriteAttributeUInt64Response(value=self._device.look())

    @rpc
    def IsTaskDone(self, _request: Any, _: object) -> Any:
        self._device.refuse_failed()
        return ni.IsTaskDoneResponse(is_task_done=False)

    @rpc
    def WaitUntilTaskDone(self, request: Any, _: object) -> Any:
        self._device.wait(request.time_to_wait)
        return ni.WaitUntilTaskDoneResponse()

    @rpc
    def ClearTask(self, request: Any, _: object) -> Any:
        if request.task.name in self._outputs:
            self._device.running = False
        return ni.ClearTaskResponse()

    @rpc
    def GetSystemInfoAttributeUInt32(self, _request: Any, _: object) -> Any:
        return ni.GetSystemInfoAttributeUInt32Response(value=25)

    def _refuse_unknown(self, channel: str) -> None:
        if channel not in CHANNELS:
            raise NiError(UNKNOWN_DEVICE)


@click.command()
@click.option("--lead", default=0.1, help="Seconds of the clock after which the scanner is on.")
@click.option("--volts-per-m", default=1.0)
@click.option("--log", type=click.Path(path_type=Path), required=True)
@click.option("--fault", type=(str, int), multiple=True)
@click.option("--timed", is_flag=True)
def main(**given: Any) -> None:
    """Serve until killed; the port is printed."""
    plant = load_plant(share_directory() / "config/plant.yaml")
    device = Device(lambda period: Piezoscanner(plant, period, seed=1), **given)
    Piezoscanner(plant, 1e-4, seed=1).advance(Trace(0, 1e-4, *np.zeros((2, 2))))  # compiles it
    server = grpc.server(ThreadPoolExecutor())
    add_NiDAQmxServicer_to_server(Server(device), server)
    click.echo(server.add_insecure_port("127.0.0.1:0"))
    sys.stdout.flush()
    server.start()
    server.wait_for_termination()


if __name__ == "__main__":
    main()
