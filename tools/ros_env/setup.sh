#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Creates the environment in which this project is built and tested:
#   tools/ros_env/setup.sh .ros && . .ros/setup.sh && python3 -m colcon build
# Where ROS 2 Jazzy is sourced: a virtual environment on top of it, with the Python packages that
# are missing. Elsewhere: a complete Jazzy underlay from PyPI's wheels (x86-64 Linux, glibc 2.28 or
# newer, Python 3.11 to 3.13, g++), with the system's Python or, where that does not suit, the first
# on PATH. PYTHON selects another interpreter.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
ros=$(realpath -m "${1:-.ros}")
# not the tracebacks of the programs that end with it; what runs in the background ignores it
trap 'kill $(jobs -p) 2> /dev/null || :; exit 130' INT
failed() { tail -n 20 "$1" >&2; return 1; }
logged() { "$@" > "$ros/setup.log" 2>&1 || failed "$ros/setup.log"; }
environment() {
  mkdir -p "$ros"
  logged "$@" "$ros"
}
# The system's Python has the optimisations that one built by pyenv lacks: the tests take a tenth
# less CPU time. It suits with venv and headers, of a version that there are wheels for.
interpreter() {
  local suits='import ensurepip, pathlib, sys, sysconfig
sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13)
         or not pathlib.Path(sysconfig.get_path("include"), "Python.h").exists())'
  if [ -n "${PYTHON-}" ]; then echo "$PYTHON"
  elif /usr/bin/python3 -c "$suits" 2> /dev/null; then echo /usr/bin/python3
  else echo python3; fi
}
# Python compiles what is imported at the first import: a small part, in half of pip's time
install=("$ros/bin/python" -m pip install --disable-pip-version-check --no-compile)
pip() { logged "${install[@]}" "$@"; }

# uv unpacks several wheels at a time, in a fifth of pip's CPU time. Where it cannot be had, or does
# not reach pip's index, it fails.
with_uv() {
  "${install[@]}" uv==0.13.9 > "$ros/setup.log" 2>&1 || return 1
  local index=${PIP_INDEX_URL:-$("$ros/bin/python" -m pip config get global.index-url 2> /dev/null)}
  UV_DEFAULT_INDEX=${index:-${UV_DEFAULT_INDEX-}} "$ros/bin/uv" pip install \
    --python "$ros/bin/python" "$@" > "$ros/setup.log" 2>&1
}

on_system() {
  environment "${PYTHON:-python3}" -m venv --system-site-packages
  pip -r "$here/python.txt"
  echo "export PATH=\"$ros/bin:\$PATH\"" > "$ros/local_setup.sh"
}

from_wheels() {
  environment "$(interpreter)" -m venv
  # --no-deps: the list is complete without ros-wheels-bootstrapper, which starts every Python of
  # the environment twice to set the variables of local_setup.sh.
  local packages=(--no-deps -r "$here/requirements.txt")
  with_uv "${packages[@]}" || pip "${packages[@]}"
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
