#!/bin/sh
# Run tests with other versions than the pinned ones, on the oldest or newest Python that is here:
# scripts/check_versions.sh lowest|newest [TESTS...]
# The lowest are those that pyproject.toml promises, the newest what pip finds today.
set -eu
cd "$(dirname "$0")/.."
. scripts/uv.sh
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

which=$1
shift
case $which in
  lowest) resolution=lowest-direct pythons=$OLDEST_FIRST ;;
  newest) resolution=highest pythons=$NEWEST_FIRST ;;
  *) echo "lowest or newest?" >&2 && exit 2 ;;
esac
python=$(find_python $pythons)
if [ -z "$python" ]; then
  echo "The $which versions are not tried: they go with Python $pythons, and none is here."
  exit 0
fi

"$uv" venv --quiet --no-project --python "$python" "$work/venv"
"$uv" pip install --quiet --python "$work/venv" --resolution "$resolution" ".[foxglove,geo,parquet]"
"$uv" pip install --quiet --python "$work/venv" httpx2 hypothesis jsonschema mcap-protobuf-support onnx \
  playwright 'pytest<9.2' pytest-cov pytest-randomly pytest-timeout pytest-xdist trimesh websockets
echo "With the $which versions, $("$work/venv/bin/python" --version):"
[ $# -gt 0 ] || set -- tests/core tests/formats tests/cli
"$work/venv/bin/hypermap" warm-up  # else the first command of a test says that it compiles
# What old versions warn of is mended in newer ones.
"$work/venv/bin/python" -m pytest -q -p no:cacheprovider -n auto --dist loadgroup \
  -W ignore::DeprecationWarning "$@"
