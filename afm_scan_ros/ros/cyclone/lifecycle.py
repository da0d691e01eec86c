"""The managed node of ROS 2 under rclpy's names, with the states and transitions of rcl_lifecycle.

``ros2 lifecycle`` finds its services and its topic ``~/transition_event``.
"""

import time
from collections.abc import Callable, Iterable
from enum import Enum
from typing import Any, NamedTuple

from attrs import frozen

from afm_scan_ros.ros.common import Message
from afm_scan_ros.ros.cyclone.message_types import message_class, service_class

State = message_class("lifecycle_msgs/msg/State")
Transition = message_class("lifecycle_msgs/msg/Transition")
TransitionDescription = message_class("lifecycle_msgs/msg/TransitionDescription")
TransitionEvent = message_class("lifecycle_msgs/msg/TransitionEvent")
ChangeState = service_class("lifecycle_msgs/srv/ChangeState")
GetState = service_class("lifecycle_msgs/srv/GetState")
GetAvailableStates = service_class("lifecycle_msgs/srv/GetAvailableStates")
GetAvailableTransitions = service_class("lifecycle_msgs/srv/GetAvailableTransitions")

_DEPTH = 10  # of ~/transition_event, as rcl's

_IDS = {
    "unknown": State.PRIMARY_STATE_UNKNOWN,
    "unconfigured": State.PRIMARY_STATE_UNCONFIGURED,
    "inactive": State.PRIMARY_STATE_INACTIVE,
    "active": State.PRIMARY_STATE_ACTIVE,
    "finalized": State.PRIMARY_STATE_FINALIZED,
    "configuring": State.TRANSITION_STATE_CONFIGURING,
    "cleaningup": State.TRANSITION_STATE_CLEANINGUP,
    "shuttingdown": State.TRANSITION_STATE_SHUTTINGDOWN,
    "activating": State.TRANSITION_STATE_ACTIVATING,
    "deactivating": State.TRANSITION_STATE_DEACTIVATING,
    "errorprocessing": State.TRANSITION_STATE_ERRORPROCESSING,
}


class LifecycleState(NamedTuple):
    """A state by its name and its number."""

    label: str
    state_id: int


class TransitionCallbackReturn(Enum):
    """How a transition's callback has ended; the values are the labels of what follows."""

    SUCCESS = "transition_success"
    FAILURE = "transition_failure"
    ERROR = "transition_error"


@frozen
class LifecycleTransition:
    """A transition between two states."""

    number: int
    label: str
    start: str
    goal: str

    def message(self) -> Message:
        """Return it with its states."""
        transition = Transition(id=self.number, label=self.label)
        start, goal = _state(self.start), _state(self.goal)
        return TransitionDescription(transition=transition, start_state=start, goal_state=goal)


def _outcomes(number: int, start: str, *goals: str) -> list[LifecycleTransition]:
    """Return what follows on success, on failure and on an error of a callback."""
    ends = enumerate(zip(TransitionCallbackReturn, goals, strict=True))
    return [
        LifecycleTransition(number + k, outcome.value, start, goal) for k, (outcome, goal) in ends
    ]


STEPS = [
    LifecycleTransition(1, "configure", "unconfigured", "configuring"),
    *_outcomes(10, "configuring", "inactive", "unconfigured", "errorprocessing"),
    LifecycleTransition(2, "cleanup", "inactive", "cleaningup"),
    *_outcomes(20, "cleaningup", "unconfigured", "inactive", "errorprocessing"),
    LifecycleTransition(3, "activate", "inactive", "activating"),
    *_outcomes(30, "activating", "active", "inactive", "errorprocessing"),
    LifecycleTransition(4, "deactivate", "active", "deactivating"),
    *_outcomes(40, "deactivating", "inactive", "active", "errorprocessing"),
    LifecycleTransition(5, "shutdown", "unconfigured", "shuttingdown"),
    LifecycleTransition(6, "shutdown", "inactive", "shuttingdown"),
    LifecycleTransition(7, "shutdown", "active", "shuttingdown"),
    *_outcomes(50, "shuttingdown", "finalized", "finalized", "errorprocessing"),
    *_outcomes(60, "errorprocessing", "unconfigured", "finalized", "finalized"),
]
"""All transitions, in the order in which rcl_lifecycle registers them."""


class LifecycleNodeMixin:
    """What makes a node a managed one; a class inherits it together with ``Node``.

    A transition calls ``on_configure``, ``on_cleanup``, ``on_activate``, ``on_deactivate`` or
    ``on_shutdown`` with the state before, and ``on_error`` where that raises or returns ERROR.
    """

    def __init__(self) -> None:
        node: Any = self  # a Node too, whose attributes rclpy's mixin uses as well
        self._state = "unconfigured"
        self._callbacks: dict[str, Callable[[LifecycleState], TransitionCallbackReturn]] = {
            "configuring": node.on_configure,
            "cleaningup": node.on_cleanup,
            "activating": node.on_activate,
            "deactivating": node.on_deactivate,
            "shuttingdown": node.on_shutdown,
            "errorprocessing": node.on_error,
        }
        self._events = node.create_publisher(TransitionEvent, "~/transition_event", _DEPTH)
        node.create_service(ChangeState, "~/change_state", self._on_change_state)
        node.create_service(GetState, "~/get_state", self._on_get_state)
        node.create_service(GetAvailableStates, "~/get_available_states", _on_get_available_states)
        for name, every in (("available_transitions", False), ("transition_graph", True)):
            node.create_service(GetAvailableTransitions, f"~/get_{name}", self._lister(every=every))

    def trigger_configure(self) -> TransitionCallbackReturn | None:
        """Configure the node; None where its state does not allow it, as for all of these."""
        return self._trigger("configure")

    def trigger_cleanup(self) -> TransitionCallbackReturn | None:
        """Undo the configuration."""
        return self._trigger("cleanup")

    def trigger_activate(self) -> TransitionCallbackReturn | None:
        """Activate the node."""
        return self._trigger("activate")

    def trigger_deactivate(self) -> TransitionCallbackReturn | None:
        """Deactivate the node."""
        return self._trigger("deactivate")

    def trigger_shutdown(self) -> TransitionCallbackReturn | None:
        """End the node, from any of its states but the final one."""
        return self._trigger("shutdown")

    def _possible(self) -> list[LifecycleTransition]:
        return [step for step in STEPS if step.start == self._state]

    def _trigger(self, name: str | int) -> TransitionCallbackReturn | None:
        """Make the transition of a label or a number, to its end."""
        found = next((step for step in self._possible() if name in (step.label, step.number)), None)
        if found is None:
            return None
        before = LifecycleState(self._state, _IDS[self._state])
        self._move(found)
        result = self._called(before)
        self._move_by(result)
        if result is TransitionCallbackReturn.ERROR:
            self._move_by(self._called(before))
        return result

    def _called(self, before: LifecycleState) -> TransitionCallbackReturn:
        try:
            return self._callbacks[self._state](before)
        except Exception:  # noqa: BLE001 - as rclpy: on_error is what follows
            return TransitionCallbackReturn.ERROR

    def _move_by(self, result: TransitionCallbackReturn) -> None:
        self._move(next(step for step in self._possible() if step.label == result.value))

    def _move(self, step: LifecycleTransition) -> None:
        self._state, said = step.goal, step.message()
        self._events.publish(
            TransitionEvent(
                timestamp=time.time_ns(),
                transition=said.transition,
                start_state=said.start_state,
                goal_state=said.goal_state,
            )
        )

    def _on_change_state(self, request: Message, response: Message) -> Message:
        asked = request.transition
        result = self._trigger(asked.label or asked.id)
        response.success = result is TransitionCallbackReturn.SUCCESS
        return response

    def _on_get_state(self, _: Message, response: Message) -> Message:
        response.current_state = _state(self._state)
        return response

    def _lister(self, *, every: bool) -> Callable[[Message, Message], Message]:
        def listed(_: Message, response: Message) -> Message:
            steps: Iterable[LifecycleTransition] = STEPS if every else self._possible()
            response.available_transitions = [step.message() for step in steps]
            return response

        return listed


def _on_get_available_states(_: Message, response: Message) -> Message:
    response.available_states = [_state(label) for label in _IDS]
    return response


def _state(label: str) -> Message:
    return State(id=_IDS[label], label=label)
