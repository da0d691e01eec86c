"""What a release and an installation on ROS need: manifest, changelog, oldest versions, script."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import Package, parse_package
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from afm_scan_ros.files import version

ROOT = Path(__file__).parents[1]
SCRIPT = ROOT / "scripts/install_on_jazzy.sh"
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of catkin_pkg itself
PIP_KEYS = {"python3-bokeh-pip", "mcap-ros2-support", "python3-rosbags-pip"}
"""Keys of rosdep that stand for packages of pip, the only ones that the package has."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
PYTHON = [*PROJECT["dependencies"], *PROJECT["optional-dependencies"]["test"]]


def manifest(distribution: str) -> Package:
    """Return package.xml as a distribution of ROS reads it."""
    warnings: list[str] = []
    package = parse_package(str(ROOT / "package.xml"), warnings=warnings)
    assert warnings == []
    package.evaluate_conditions({"ROS_DISTRO": distribution})
    return package


def needed(distribution: str) -> set[str]:
    """Return the keys that a distribution needs to run the package."""
    return {each.name for each in manifest(distribution).exec_depends if each.evaluated_condition}


def test_the_manifest_is_complete_and_invents_no_address() -> None:
    package = manifest("jazzy")
    (maintainer,) = package.maintainers
    assert maintainer.email.endswith("@users.noreply.github.com")
    assert package.urls == package.authors == []
    assert package.licenses == ["Apache-2.0"]


@pytest.mark.parametrize("distribution", ["jazzy", "kilted", "lyrical"])
def test_pip_has_two_keys_and_numba_one_where_ubuntu_packages_it(distribution: str) -> None:
    keys = needed(distribution)
    assert {key for key in keys if key.endswith("-pip") or "mcap-" in key} == PIP_KEYS
    assert ("python3-numba" in keys) == (distribution == "lyrical")


def test_the_changelog_has_the_form_of_rep_132() -> None:
    """As it is released: catkin_prepare_release gives what is forthcoming version and date."""
    text = (ROOT / "CHANGELOG.rst").read_text("utf-8")
    assert text.count("Forthcoming\n-----------\n") == 1
    assert "](" not in text  # a link of Markdown
    heading = f"{version()} (2026-01-01)"
    released = text.replace("Forthcoming\n-----------", f"{heading}\n{'-' * len(heading)}")
    changelog = Changelog("afm_scan_ros")
    populate_changelog_from_rst(changelog, released)
    assert changelog.package_name == "afm_scan_ros"
    (newest, _, content), *_ = changelog.foreach_version()
    assert newest == version()
    assert len(content) > 1


def test_each_oldest_version_is_tried_and_stated() -> None:
    tried = dict(
        re.findall(
            r"^(\S+)==([\d.]+)", (ROOT / ".ci/ubuntu_24.04.txt").read_text("utf-8"), re.MULTILINE
        )
    )
    page = (ROOT / "docs/dependencies.md").read_text("utf-8")
    asked = dict(each.partition(",")[0].split(">=") for each in PYTHON if ">=" in each)
    assert tried.keys() <= asked.keys()
    assert {name: asked[name] for name in tried} == tried
    assert all(oldest in page for oldest in tried.values())


def test_the_checks_lock_what_is_asked_for() -> None:
    """A version within the bounds of each dependency."""
    text = (ROOT / ".ci/lock.txt").read_text("utf-8")
    found = re.findall(r"^(\S+)==(\S+)$", text, re.MULTILINE)
    locked = {canonicalize_name(name): number for name, number in found}
    for each in map(Requirement, PYTHON):
        assert each.specifier.contains(locked[canonicalize_name(each.name)]), each


def test_the_scripts_are_sound() -> None:
    scripts = [*(ROOT / "scripts").glob("*.sh"), ROOT / ".ci/run"]
    assert all(script.stat().st_mode & 0o111 for script in scripts)
    bash = shutil.which("bash")
    assert bash is not None
    for script in scripts:
        subprocess.run([bash, "-n", script], check=True)
    beside = Path(sys.executable).parent / "shellcheck"
    checker = str(beside) if beside.exists() else shutil.which("shellcheck")
    if checker is None:
        pytest.skip("shellcheck is not installed")
    subprocess.run([checker, *scripts], check=True)


def test_the_script_names_what_there_is() -> None:
    text = SCRIPT.read_text("utf-8")
    assert set(words(text, "pip_keys=(", ")")) == PIP_KEYS <= needed("jazzy")
    without_package = {"bokeh", "mcap", "numba", "rosbags"}
    asked = {each for each in PYTHON if each.split(">=")[0] in without_package}
    assert {each.strip('"') for each in words(text, "from_pip=(", ")")} == asked
    assert set(words(text, "--packages-select ", "\n")) == {manifest("jazzy").name}
    assert set(words(text, "pkg executables ", "\n")) == {manifest("jazzy").name}
    executables = (ROOT / "resource/executables.txt").read_text("utf-8")
    assert "\nafm-scan --version\n" in text
    assert executables.startswith("afm-scan = ")
    page = (ROOT / "docs/how_to/ros2_jazzy.md").read_text("utf-8")
    assert f"{SCRIPT.relative_to(ROOT)} ~/afm_scan_ws" in page
    for file in ("/opt/ros/jazzy/setup.bash", "install/setup.bash", "venv/bin/activate"):
        assert file in text
        assert f"{file}\n" in page
    apt = {"python3-colcon-common-extensions", "python3-rosdep", "python3-venv"}
    assert set(words(text, "apt-get install -y ", "\n")) == apt
    assert all(f"`{name}`" in page for name in apt)


def words(text: str, before: str, after: str) -> list[str]:
    """Return the words between two parts of a text."""
    return text.partition(before)[2].partition(after)[0].split()
