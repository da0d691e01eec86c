"""What ``--ros-args`` means: the rules of rcl, as laws and as a table."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_scan_ros.core.errors import InputError
from afm_scan_ros.ros.cyclone.base import (
    Arguments,
    Remap,
    namespace,
    node_name,
    parse_arguments,
    resolve,
)

WORD = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
NAME = st.lists(WORD, min_size=1, max_size=3).map("/".join)
SPACE = st.lists(WORD, max_size=2).map(lambda words: "/" + "/".join(words))


def ros_args(*words: str) -> Arguments:
    return parse_arguments(["program", "--own", "1", "--ros-args", *words, "--", "--own", "2"])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("5", 5),
        ("5.0", 5.0),
        ("1e-6", 1e-6),
        ("off", False),
        ("Yes", True),
        ("none", "none"),
        ("0x1F", 31),
        ('"5"', "5"),
        ("[1.0, 2.0]", [1.0, 2.0]),
        ("a:=b", "a:=b"),
    ],
)
def test_a_parameter_is_typed_as_rcl_types_it(text: str, value: object) -> None:
    given_for = ros_args("-p", f"name:={text}").for_node("/node")
    assert given_for == {"name": value}
    assert type(given_for["name"]) is type(value)


@given(st.integers(-(2**63), 2**63 - 1))
def test_whole_numbers_are_integers(number: int) -> None:
    assert ros_args("-p", f"name:={number}").for_node("/node") == {"name": number}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_with_a_point_or_an_exponent_are_doubles(number: float) -> None:
    found = ros_args("-p", f"name:={number!r}").for_node("/node")["name"]
    assert isinstance(found, float)
    assert found == number


@pytest.mark.parametrize(
    ("key", "node", "fits"),
    [
        ("/**", "/lab/scanner", True),
        ("/**/scanner", "/scanner", True),
        ("/**/scanner", "/lab/a/scanner", True),
        ("/**/scanner", "/lab/scanner2", False),
        ("/*/scanner", "/lab/scanner", True),
        ("/*/scanner", "/scanner", False),
        ("/(s|c)+anner", "/scanner", False),
        ("/**/sc(anner", "/lab/scanner", False),
        ("/lab/scanner", "/lab/scanner", True),
        ("scanner", "/scanner", True),
        ("scanner", "/lab/scanner", False),
    ],
)
def test_a_key_means_the_nodes_that_it_means_in_rcl(key: str, node: str, *, fits: bool) -> None:
    assert bool(ros_args("-p", f"{key}:gain:=1").for_node(node)) is fits


def test_a_file_gives_parameters_and_a_later_word_wins(tmp_path: Path) -> None:
    file = tmp_path / "scan.yaml"
    file.write_text("/**/scanner:\n  ros__parameters:\n    gain: 1e-6\n    limits: {low: -4.0}\n")
    found = ros_args("--params-file", str(file), "-p", "gain:=2.0").for_node("/lab/scanner")
    assert found == {"gain": 2.0, "limits.low": -4.0}
    assert ros_args("--params-file", str(file)).for_node("/lab/other") == {}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["-p", "gain=1"], "-p NAME:=VALUE"),
        (["-p", "gain:="], "gain"),
        (["-p"], "missing"),
        (["-r", "a"], "-r NAME:=VALUE"),
        (["--params-file", "/nowhere.yaml"], "/nowhere.yaml"),
        (["--enclave", "/a"], "--enclave"),
    ],
)
def test_bad_arguments_are_refused_by_name(words: list[str], told: str) -> None:
    with pytest.raises(InputError, match=told):
        ros_args(*words)


@pytest.mark.parametrize(
    "text", ["scanner:\n  gain: 1\n", "scanner:\n  ros__parameters: 3\n", "scanner: 1\n"]
)
def test_a_file_that_is_no_parameter_file_is_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "scan.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match="ros__parameters"):
        ros_args("--params-file", str(file))


@given(NAME, WORD, SPACE)
def test_names_are_expanded_as_ros_expands_them(name: str, node: str, space: str) -> None:
    root = space.rstrip("/")
    assert resolve(name, node, space, []) == f"{root}/{name}"
    assert resolve(f"/{name}", node, space, []) == f"/{name}"
    assert resolve(f"~/{name}", node, space, []) == f"{root}/{node}/{name}"


@given(NAME, NAME, WORD, SPACE)
def test_a_remap_is_applied_once_and_to_its_node_alone(
    source: str, target: str, node: str, space: str
) -> None:
    swap = [Remap(node, source, target), Remap(node, target, source)]
    assert resolve(source, node, space, swap) == resolve(target, node, space, [])
    assert resolve(source, f"{node}_", space, swap) == resolve(source, f"{node}_", space, [])


def test_node_and_namespace_are_remapped() -> None:
    rules = ros_args("-r", "__ns:=/lab", "-r", "scanner:__node:=other").remaps
    assert node_name("scanner", rules) == "other"
    assert node_name("generator", rules) == "generator"
    assert namespace("scanner", rules) == "/lab"
    assert namespace("scanner", []) == "/"


@pytest.mark.parametrize("name", ["", "1a", "a//b", "a b", "a/", "~a"])
def test_a_name_that_ros_refuses_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="is no topic"):
        resolve(name, "node", "/", [])
