#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Creates the environment in which this project is built and tested:
#   tools/ros_env/setup.sh .ros && . .ros/setup.sh && python3 -m colcon build
# Where ROS 2 Jazzy is sourced: a virtual environment on top of it, with the Python packages that
# are missing. Elsewhere: a complete Jazzy underlay from PyPI's wheels (x86-64 Linux, glibc 2.28 or
# newer, Python 3.11 to 3.13, g++). PYTHON selects another interpreter.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
ros=$(realpath -m "${1:-.ros}")
# not the tracebacks of the programs that end with it; what runs in the background ignores it
trap 'kill $(jobs -p) 2> /dev/null || :; exit 130' INT
failed() { tail -n 20 "$1" >&2; return 1; }
logged() { "$@" > "$ros/setup.log" 2>&1 || failed "$ros/setup.log"; }
environment() {
  mkdir -p "$ros"
  logged "${PYTHON:-python3}" -m venv "$@" "$ros"
}
# Python compiles what is imported at the first import: a small part, in half of pip's time
install=("$ros/bin/python" -m pip install --disable-pip-version-check --no-compile)
pip() { logged "${install[@]}" "$@"; }

on_system() {
  environment --system-site-packages
  pip -r "$here/python.txt"
  echo "export PATH=\"$ros/bin:\$PATH\"" > "$ros/local_setup.sh"
}

from_wheels() {
  environment
  # --no-deps: the list is complete without ros-wheels-bootstrapper, which starts every Python of
  # the environment twice to set the variables of local_setup.sh. Two halves at a time, as pip loads
  # and unpacks one wheel after another.
  sed -n 'p;n' "$here/requirements.txt" > "$ros/odd.txt"
  sed -n 'n;p' "$here/requirements.txt" > "$ros/even.txt"
  "${install[@]}" --no-deps -r "$ros/odd.txt" > "$ros/setup_odd.log" 2>&1 &
  local odd=$!
  pip --no-deps -r "$ros/even.txt" || { kill "$odd" 2> /dev/null || :; return 1; }
  wait "$odd" || failed "$ros/setup_odd.log"
  # The wheels' CMake files name their builder's Python; what is built here adds its own include
  # folders.
  sed -i -E 's#/opt/python/[^;"]*;?##g' "$ros"/share/*/cmake/*_pyExport.cmake
  # One folder for the libraries that the wheels keep apart.
  ln -sf "$ros"/lib/python3.*/site-packages/ros_*.libs/*.so* "$ros/lib/"
  # What sourcing /opt/ros/jazzy would set. colcon chains a prefix that has local_setup.*, so after
  # a build install/setup.bash alone is enough.
  cat > "$ros/local_setup.sh" <<EOS
case ":\${AMENT_PREFIX_PATH-}:" in *":$ros:"*) ;; *)
  export AMENT_PREFIX_PATH="\${AMENT_PREFIX_PATH:+\$AMENT_PREFIX_PATH:}$ros"
  export LD_LIBRARY_PATH="\${LD_LIBRARY_PATH:+\$LD_LIBRARY_PATH:}$ros/lib"
  export PATH="$ros/bin:\$PATH" ;;
esac
export ROS_DISTRO=jazzy ROS_VERSION=2 ROS_PYTHON_VERSION=3
export CMAKE_GENERATOR=Ninja
EOS
}

rm -rf "$ros"
case ":${AMENT_PREFIX_PATH-}:" in
  *":$ros:"*) from_wheels ;;                       # our own underlay, sourced before
  *) if [ "${ROS_DISTRO-}" = jazzy ]; then on_system; else from_wheels; fi ;;
esac
for name in local_setup.bash setup.sh setup.bash; do
  echo ". '$ros/local_setup.sh'" > "$ros/$name"
done
