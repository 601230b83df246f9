#!/bin/sh
# Check that every requirement can be had as a wheel on the computers that robots and people have:
# scripts/check_platforms.sh [REQUIREMENTS]. The registry is only asked, nothing is installed.
set -eu
cd "$(dirname "$0")/.."
. scripts/uv.sh
requirements=${1:-requirements/hypermap.txt}
errors=$(mktemp)
trap 'rm -f "$errors"' EXIT
export MACOSX_DEPLOYMENT_TARGET=14.0

ask() {  # ask PLATFORM PYTHON OPTIONS...
  platform=$1 python=$2
  shift 2
  "$uv" pip compile --quiet --no-deps --only-binary :all: --python-platform "$platform" \
    --python-version "$python" "$@" "$requirements" >/dev/null 2>"$errors"
}

check() {  # check PLATFORM PYTHON
  # uv caches package metadata for all platforms, so the first one takes longest.
  ask "$@" --offline || ask "$@" || failed=$?
  [ -n "${failed:-}" ] || return 0
  if grep -q 'error sending request' "$errors"; then
    echo "Requirements are not looked up for other computers: the registry cannot be reached."
    exit 0
  fi
  echo "On $1, with Python $2:" >&2
  cat "$errors" >&2
  exit 1
}

check x86_64-pc-windows-msvc 3.10
check aarch64-manylinux_2_28 3.10
check aarch64-manylinux_2_28 3.13
check aarch64-apple-darwin 3.13
