#!/bin/sh
# Makes or updates the environment in .venv: system packages, interpreter, pinned Python packages.
# Run by make. PYTHON=/path/to/python3 chooses the interpreter; pip's own settings (PIP_*) hold.
set -eu
cd "$(dirname "$0")"

venv=.venv

# What the open3d wheel links against and does not bring, as library:package of Debian and Ubuntu.
system_libraries="
libEGL.so.1:libegl1
libGL.so.1:libgl1
libX11.so.6:libx11-6
libusb-1.0.so.0:libusb-1.0-0
libudev.so.1:libudev1
libidn2.so.0:libidn2-0
"

stop() { # one line per argument
  printf 'setup: ' >&2
  printf '%s\n' "$@" >&2
  exit 1
}

supported() { # the range of requires-python in pyproject.toml
  "$1" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] < (3, 14))' 2>/dev/null
}

find_python() {
  for candidate in ${PYTHON:-python3 python3.13 python3.12 python3.11}; do
    if supported "$candidate"; then
      command -v "$candidate"
      return
    fi
  done
}

without_python() {
  found=$("${PYTHON:-python3}" --version 2>/dev/null || echo "none")
  stop "MapSense needs Python 3.11, 3.12 or 3.13 with its venv module; ${PYTHON:-python3} is: $found." \
    "On Debian 12 or 13 and Ubuntu 24.04:  sudo apt-get install -y python3 python3-venv" \
    "On Ubuntu 22.04:                      sudo apt-get install -y python3.11 python3.11-venv" \
    "An interpreter elsewhere:             make PYTHON=/path/to/python3.12"
}

missing_packages() {
  "$python" -c 'import ensurepip, venv' 2>/dev/null ||
    "$python" -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])'
  [ "$(uname -s)" = Linux ] || return 0 # elsewhere the wheel brings its own
  "$python" - $system_libraries <<'PY'
import ctypes
import sys

for library, package in (pair.split(":") for pair in sys.argv[1:]):
    try:
        ctypes.CDLL(library)
    except OSError:
        print(package)
PY
}

install_packages() {
  if ! command -v apt-get >/dev/null; then
    stop "missing on this system, by their names in Debian and Ubuntu: $*" \
      "Install their counterparts here, then run the same command again."
  elif [ "$(id -u)" -eq 0 ]; then
    sudo=""
  elif sudo -n true 2>/dev/null; then
    sudo="sudo"
  else
    stop "system packages are missing. Run this, then the same command again:" \
      "  sudo apt-get update && sudo apt-get install -y $*"
  fi
  echo "setup: installing system packages: $*"
  # A source that does not answer need not matter: the install tells.
  $sudo apt-get update -qq || true
  $sudo env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "$@" </dev/null >/dev/null
}

python=$(find_python)
[ -n "$python" ] || without_python

missing=$(missing_packages | xargs)
[ -z "$missing" ] || install_packages $missing

# An environment of another interpreter, or one that was left half made, is made anew.
version_of() { "$1" -c 'import sys; print(sys.version)' 2>/dev/null; }
if [ "$(version_of "$venv/bin/python")" != "$(version_of "$python")" ] ||
  ! "$venv/bin/python" -c 'import pip' 2>/dev/null; then
  "$python" -m venv --clear "$venv"
fi

echo "setup: installing the packages of constraints.txt into $venv"
# The interpreter's own pip may be too old to know --group, so the pinned one comes first.
"$venv/bin/python" -m pip install --quiet -c constraints.txt pip
"$venv/bin/python" -m pip install --quiet -c constraints.txt --build-constraint constraints.txt \
  -e . --group dev
"$venv/bin/python" -m pip check
