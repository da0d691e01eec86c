"""No node of ours takes a name that rclpy's Node needs for itself."""

import ast
from pathlib import Path

import pytest
from rclpy.lifecycle import LifecycleNode

from helpers.ros import joined

FILES = sorted((Path(__file__).parents[2] / "afm_scan_ros/nodes").glob("*.py"))
TO_BE_EXTENDED = {"destroy_node", "__init__"}


@pytest.fixture(scope="module")
def of_rclpy() -> set[str]:
    """Return the names of all that a managed node has, but for what is there to be extended."""
    with joined():
        node = LifecycleNode("tested")
        found = {*dir(node)} - TO_BE_EXTENDED
        node.destroy_node()
    return {name for name in found if not name.startswith("on_")}


def names_taken(path: Path) -> set[str]:
    """Methods of the classes in a file and the attributes that they assign to themselves."""
    taken = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ClassDef) and node.bases:
            taken |= {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            taken.add(node.attr)
    return taken


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_node_takes_a_name_of_rclpys(of_rclpy: set[str], path: Path) -> None:
    assert not names_taken(path) & of_rclpy
