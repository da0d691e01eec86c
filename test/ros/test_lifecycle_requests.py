"""A request for a transition that is not possible changes nothing."""

from collections.abc import Iterator
from importlib.util import find_spec

import pytest

from afm_scan_ros import ros
from afm_scan_ros.ros.cyclone.lifecycle import STEPS, ChangeState, LifecycleTransition, Transition

pytestmark = pytest.mark.skipif(find_spec("rclpy") is not None, reason="of the stand-in")
DONE = ros.TransitionCallbackReturn.SUCCESS


class Managed(ros.LifecycleNodeMixin, ros.Node):
    """A managed node that does nothing, and notes what it is told to do."""

    def __init__(self) -> None:
        ros.Node.__init__(self, "managed")
        self.told: list[str] = []
        ros.LifecycleNodeMixin.__init__(self)

    def note(self, state: ros.LifecycleState) -> ros.TransitionCallbackReturn:
        self.told.append(state.label)
        return DONE

    on_configure = on_activate = on_deactivate = on_cleanup = on_shutdown = on_error = note


@pytest.fixture
def node() -> Iterator[Managed]:
    ros.init(args=[], signal_handler_options=ros.SignalHandlerOptions.NO)
    yield Managed()
    ros.shutdown()


@pytest.mark.parametrize("step", STEPS, ids=lambda step: f"{step.number}")
def test_only_what_begins_here_is_done(node: Managed, step: LifecycleTransition) -> None:
    request = ChangeState.Request(transition=Transition(id=step.number))
    response = node._on_change_state(request, ChangeState.Response())  # noqa: SLF001 - the service
    assert response.success == (step.number in (1, 5))
    assert node.told == (["unconfigured"] if response.success else [])
