"""A parameter that a node does not have is named."""

from afm_scan_ros import ros


def test_a_parameter_that_is_set_and_unknown_is_named() -> None:
    ros.init(
        args=["node", "--ros-args", "-p", "line_rate:=30.0", "-p", "known:=1"],
        signal_handler_options=ros.SignalHandlerOptions.NO,
    )
    try:
        node = ros.Node("node")
        node.declare_parameter("known", 0)
        assert ros.undeclared_parameters(node) == ["line_rate"]
    finally:
        ros.try_shutdown()
