#!/bin/sh
# Run tests with the lowest versions that pyproject.toml promises, on the oldest Python that is here:
# scripts/check_lowest.sh [TESTS...]
set -eu
cd "$(dirname "$0")/.."
uv=.venv/bin/uv
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

for version in 3.10 3.11 3.12; do
  # Those of pyenv are found as well, on PATH or not; none is downloaded.
  python=$("$uv" python find --quiet --no-project --no-python-downloads "$version" 2>/dev/null) ||
    python=$(ls -d "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python 2>/dev/null | tail -n 1)
  [ -z "$python" ] || break
done
if [ -z "$python" ]; then
  echo "The lowest versions are not tried: they go with Python 3.10 to 3.12, and none is here."
  exit 0
fi

"$uv" venv --quiet --no-project --python "$python" "$work/venv"
"$uv" pip install --quiet --python "$work/venv" --resolution lowest-direct ".[foxglove,geo,parquet]"
"$uv" pip install --quiet --python "$work/venv" httpx2 hypothesis mcap-protobuf-support onnx \
  playwright 'pytest<9.2' pytest-cov pytest-timeout pytest-xdist trimesh websockets
echo "With the lowest versions, $("$work/venv/bin/python" --version):"
[ $# -gt 0 ] || set -- tests/core tests/formats tests/cli
# What old versions warn of is mended in newer ones.
"$work/venv/bin/python" -m pytest -q -p no:cacheprovider -n auto --dist loadgroup \
  -W ignore::DeprecationWarning "$@"
