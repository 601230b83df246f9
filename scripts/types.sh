#!/bin/sh
# Check types, against one set of requirements: that which is pinned for Python 3.11. Those of other
# Pythons come with another numpy, whose types differ.
set -eu
cd "$(dirname "$0")/.."
bin=${VENV:-.venv}/bin
if ! "$bin/python" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))'; then
  echo "Types are not checked: that is done with Python 3.11 (make types PYTHON=python3.11)"
  exit 0
fi
"$bin/mypy"
"$bin/mypy" --strict examples/flow_layer/src examples/*.py
