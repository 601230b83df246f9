#!/bin/sh
# Run tests with other versions than the pinned ones, on the oldest or newest Python that is here:
# scripts/check_versions.sh lowest|newest [TESTS...]
# The lowest are those that pyproject.toml promises, the newest what pip finds today.
set -eu
cd "$(dirname "$0")/.."
uv=$PWD/${VENV:-.venv}/bin/uv
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

which=$1
shift
case $which in
  lowest) resolution=lowest-direct pythons="3.10 3.11 3.12" ;;
  newest) resolution=highest pythons="3.14 3.13 3.12 3.11" ;;
  *) echo "lowest or newest?" >&2 && exit 2 ;;
esac
for version in $pythons; do
  # Those of pyenv are found as well, on PATH or not; none is downloaded.
  python=$("$uv" python find --quiet --no-project --no-python-downloads "$version" 2>/dev/null) ||
    python=$(ls -d "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python 2>/dev/null | tail -n 1)
  [ -z "$python" ] || break
done
if [ -z "$python" ]; then
  echo "The $which versions are not tried: they go with Python $pythons, and none is here."
  exit 0
fi

"$uv" venv --quiet --no-project --python "$python" "$work/venv"
"$uv" pip install --quiet --python "$work/venv" --resolution "$resolution" ".[foxglove,geo,parquet]"
"$uv" pip install --quiet --python "$work/venv" httpx2 hypothesis mcap-protobuf-support onnx \
  playwright 'pytest<9.2' pytest-cov pytest-randomly pytest-timeout pytest-xdist trimesh websockets
echo "With the $which versions, $("$work/venv/bin/python" --version):"
[ $# -gt 0 ] || set -- tests/core tests/formats tests/cli
# What old versions warn of is mended in newer ones.
"$work/venv/bin/python" -m pytest -q -p no:cacheprovider -n auto --dist loadgroup \
  -W ignore::DeprecationWarning "$@"
