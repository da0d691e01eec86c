"""Base of the nodes that own hardware, with the states of ROS's lifecycle."""

import traceback
from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from rclpy._rclpy_pybind11 import RCLError
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from afm_scan_ros.core.errors import InputError, ScanError
from afm_scan_ros.nodes.block_consumer import BlockConsumer
from afm_scan_ros.nodes.messages import Message
from afm_scan_ros.nodes.parameters import NodeParameter
from afm_scan_ros.nodes.peers import DONE

AUTOSTART = NodeParameter(
    "autostart", default=True, description="Whether the node configures and activates itself"
)

_CONFIGURE, _ACTIVATE = "waits to be configured", "waits to be activated"


class ManagedConsumer(LifecycleNodeMixin, BlockConsumer):
    """A consumer with the states unconfigured, inactive, active and finalized.

    Configure opens the hardware, and cleanup closes it. Only an active node takes part in a scan.
    One that is deactivated in a scan ramps down, fails and ends, as it does after an error in a
    transition; shutdown ends it too.
    """

    def __init__(self) -> None:
        BlockConsumer.__init__(self)
        LifecycleNodeMixin.__init__(self)
        changes = self._service_change_state
        changes.callback = partial(_changed_if_possible, changes.callback)
        self.is_active = False
        self.reason = _CONFIGURE

    @abstractmethod
    def open(self) -> None:
        """Open the hardware, its outputs at rest; raises InputError or ScanError."""

    @abstractmethod
    def close(self) -> None:
        """Bring the outputs to rest and close the hardware, if it is open."""

    def autostart(self) -> None:
        """Configure and activate the node where its parameter says so; call it when it is made."""
        if self.settings[AUTOSTART.name]:
            self.trigger_configure()
            if not self.leaving:
                self.trigger_activate()

    def step(self) -> bool:
        """Wait until the node is active."""
        return self.is_active and super().step()

    def refuses(self) -> bool:
        """Return whether a block must not move anything, whoever sent it."""
        return not self.is_active or self.is_unready

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002 - rclpy's
        """Open the hardware."""
        return self._changed(self.open, _ACTIVATE)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002 - rclpy's
        """Take part in scans."""
        return self._changed(self._activate, "" if self.info else "waits for scan_info")

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002 - rclpy's
        """Take part in no scan; ramp down where one runs."""
        return self._changed(self._deactivate, _ACTIVATE)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002 - rclpy's
        """Close the hardware."""
        return self._changed(self.close, _CONFIGURE)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002 - rclpy's
        """Close the hardware and end the node."""
        return self._changed(self._shut_down, "shut down")

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Ramp down and end; the transition that failed has done so, but for an error of rclpy."""
        self.fail(ScanError(f"a transition from {state.label} failed"))
        return TransitionCallbackReturn.FAILURE

    def destroy_node(self) -> None:
        """Close the hardware too."""
        try:
            with suppress(RCLError):  # finalized already
                self.trigger_shutdown()
        finally:
            self.close()
            super().destroy_node()

    def _changed(self, work: Callable[[], None], reason: str) -> TransitionCallbackReturn:
        """Make a change; an error fails the node before rclpy would drop it."""
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever it is, the outputs are ramped down
            if not isinstance(error, InputError | ScanError):
                self.get_logger().error("".join(traceback.format_exception(error)))
            self.fail(error)
            return TransitionCallbackReturn.ERROR
        if not self.leaving:
            self.reason = reason
        return TransitionCallbackReturn.SUCCESS

    def _activate(self) -> None:
        self.is_active = True

    def _deactivate(self) -> None:
        self.is_active = False
        if self.state == DONE:
            self.leave()  # and ramps down, as after any scan
        elif self.info is not None:
            self.fail(ScanError(f"deactivated at sample {self.next_sample}"))

    def _shut_down(self) -> None:
        self._deactivate()
        self.close()
        if not self.leaving:
            self.leave()


def _changed_if_possible(
    change: Callable[[Message, Message], Message], request: Message, response: Message
) -> Message:
    """Answer a transition that the state does not allow, at which rclpy would end the node."""
    try:
        return change(request, response)
    except RCLError:
        response.success = False
        return response
