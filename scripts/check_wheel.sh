#!/bin/sh
# Build the wheel and run the command from it, away from the checkout.
set -eu
cd "$(dirname "$0")/.."
python=$PWD/.venv/bin/python
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" -m build --quiet --wheel --no-isolation --outdir "$work/dist" . >/dev/null
"$python" -m pip install --quiet --disable-pip-version-check --no-deps --target "$work/site" "$work"/dist/*.whl
cd "$work"
PYTHONPATH=$work/site "$python" -c '
import hypermap
from pathlib import Path
package = Path(hypermap.__file__).parent
assert package.parent.name == "site", package
for file in ("py.typed", "simulation/worlds/demo.yaml"):
    assert (package / file).is_file(), f"the wheel lacks {file}"
'
PYTHONPATH=$work/site "$python" -m hypermap --version
