#!/usr/bin/env bash
# Builds afm_scan_ros on Ubuntu 24.04 with ROS 2 Jazzy. The system's own Python stays as it is.
#
#   scripts/install_on_jazzy.sh [WORKSPACE]    (~/afm_scan_ws by default)
#
# What Ubuntu packages comes from apt, by rosdep. The rest goes into a virtual environment that sees
# the system's packages. Run again, it brings the workspace up to date. ROS_SETUP names the setup.bash
# of a ROS 2 in another place.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
workspace=${1:-$HOME/afm_scan_ws}
ros=${ROS_SETUP:-/opt/ros/jazzy/setup.bash}
from_pip=("bokeh>=3.9.0,<4" "mcap>=1.5,<2" "numba>=0.59.0,<1" "rosbags>=0.10,<0.12")
pip_keys=(python3-bokeh-pip mcap-ros2-support python3-rosbags-pip)

if [ ! -f "$ros" ]; then
  echo "install_on_jazzy.sh: $ros is missing: install ROS 2 Jazzy first" >&2
  exit 2
fi

as_root() {
  if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi
}

enter() { # ROS's own scripts read variables that are not set
  set +u
  # shellcheck disable=SC1090
  source "$1"
  set -u
}

as_root apt-get update
as_root apt-get install -y python3-colcon-common-extensions python3-rosdep python3-venv
if [ ! -f /etc/ros/rosdep/sources.list.d/20-default.list ]; then
  as_root rosdep init
fi
rosdep update --rosdistro jazzy

# Before the virtual environment is entered: what is built belongs to the system's Python.
enter "$ros"
rosdep install -y --rosdistro jazzy --ignore-src --from-paths "$root" --skip-keys "${pip_keys[*]}"
mkdir -p "$workspace"
cd "$workspace"
# colcon leaves the modules of an earlier version, and effects and features are found by their files.
rm -rf build/afm_scan_ros install/afm_scan_ros
colcon build --base-paths "$root" --packages-select afm_scan_ros

# The system's numpy stays the only one: scipy and matplotlib of the system are built for it.
python3 -m venv --system-site-packages venv
touch venv/COLCON_IGNORE
numpy=$(python3 -c "import numpy; print(numpy.__version__)")
venv/bin/python -m pip install --upgrade "numpy==$numpy" "${from_pip[@]}"

enter install/setup.bash
enter venv/bin/activate
afm-scan --version
ros2 pkg executables afm_scan_ros

echo "Done. In each new terminal:"
printf '  source %s\n' "$ros" "$workspace/install/setup.bash" "$workspace/venv/bin/activate"
