#!/bin/sh
# Make the virtual environment of this checkout: scripts/venv.sh REQUIREMENTS...
# PYTHON names the interpreter (default: python3); VENV the folder (default: .venv).
# Only files whose hashes stand in the requirements are installed.
set -eu
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
venv=${VENV:-.venv}

if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))'; then
  echo "Hypermap needs Python 3.10 or newer, as $python; say which with: make PYTHON=python3.12" >&2
  exit 1
fi

if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
  # Debian keeps these two modules in a package of their own.
  if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
    apt-get update -q && apt-get install -q -y python3-venv
  else
    echo "$python cannot make virtual environments; on Debian: sudo apt-get install python3-venv" >&2
    exit 1
  fi
fi

[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
for requirements in "$@"; do
  "$venv/bin/python" -m pip install --quiet --disable-pip-version-check --require-hashes -r "$requirements"
done
# The package itself goes where its build backend is required.
grep -q '^setuptools' "$@" || exit 0
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
  --no-deps --no-build-isolation -e . -e examples/flow_layer
