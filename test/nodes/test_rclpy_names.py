"""No node of ours takes a name that rclpy's Node needs for itself: the stand-in would not tell."""

import ast
import re
from pathlib import Path

import pytest

NODES = sorted((Path(__file__).parents[2] / "afm_scan_ros/nodes").glob("*.py"))

# Attributes, properties and methods of rclpy.node.Node (rclpy/node.py of ROS 2 Jazzy) and of
# rclpy.lifecycle.LifecycleNodeMixin that a subclass could take by mistake; destroy_node and on_...
# are there to be extended.
OF_RCLPY = frozenset(
    re.findall(
        r"\w+",
        """
    _allow_undeclared_parameters _callbacks _clients _clock _context _default_callback_group
    _descriptors _guards _logger _logger_service _on_set_parameters_callbacks
    _parameter_event_publisher
    _parameter_overrides _parameter_service _parameters _post_set_parameters_callbacks
    _pre_set_parameters_callbacks _publishers _rate_group _services _subscriptions _time_source
    _timers _type_description_service _waitables
    add_waitable clients context count_clients count_publishers count_services count_subscribers
    create_client create_guard_condition create_publisher create_rate create_service
    create_subscription create_timer declare_parameter declare_parameters default_callback_group
    describe_parameter describe_parameters destroy_client destroy_guard_condition
    destroy_publisher destroy_rate destroy_service destroy_subscription destroy_timer executor
    get_clock get_fully_qualified_name get_logger get_name get_namespace get_node_names
    get_parameter get_parameters get_topic_names_and_types guards handle has_parameter publishers
    _managed_entities _service_change_state _service_get_available_states
    _service_get_available_transitions _service_get_state _service_get_transition_graph
    _state_machine add_managed_entity create_lifecycle_publisher destroy_lifecycle_publisher
    trigger_activate trigger_cleanup trigger_configure trigger_deactivate trigger_shutdown
    remove_waitable resolve_service_name resolve_topic_name services set_descriptor
    set_parameters set_parameters_atomically subscriptions timers undeclare_parameter
    wait_for_node waitables
    """,
    )
)


def names_taken(path: Path) -> set[str]:
    """Methods of the classes in a file and the attributes that they assign to themselves."""
    taken = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ClassDef):
            taken |= {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            taken.add(node.attr)
    return taken


@pytest.mark.parametrize("path", NODES, ids=lambda path: path.stem)
def test_no_node_takes_a_name_of_rclpys(path: Path) -> None:
    assert not names_taken(path) & OF_RCLPY
