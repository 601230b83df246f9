#!/bin/sh
# Build the page that `hypermap view` opens, into src/hypermap/viewer/page: scripts/page.sh
# With "check" it is only checked: types, format, and the tests of what needs no browser.
# Where Node.js is missing, it is installed from the Python registry, into .venv-node.
set -eu
cd "$(dirname "$0")/.."
status=0
"${PYTHON:-python3}" scripts/build_page.py "$@" || status=$?
[ "$status" = 3 ] || exit "$status"  # 3: no Node.js
echo "it is taken from a Python package, into .venv-node" >&2
if ! [ .venv-node/.node -nt requirements/node.txt ]; then
  VENV=.venv-node scripts/venv.sh requirements/node.txt
  touch .venv-node/.node
fi
exec .venv-node/bin/python scripts/build_page.py "$@"
