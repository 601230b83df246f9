#!/bin/sh
# Pin every requirement for Python 3.10 and newer, with the hash of every file that pip may take for it on any
# computer, and without naming an index. Extras are named: pip 23 and older would take the newest release
# for a requirement like coverage[toml] where only coverage is pinned, and refuse it, as it has no hash.
set -eu
cd "$(dirname "$0")/.."
tool=$(mktemp -d)
trap 'rm -rf "$tool"' EXIT
python3 -m venv "$tool" && "$tool/bin/pip" install --quiet uv

pin() {  # pin OUTPUT ARGUMENTS...
  output=$1
  shift
  "$tool/bin/uv" pip compile --quiet --universal --python-version 3.10 --no-header --no-annotate \
    --no-strip-extras --no-emit-index-url --generate-hashes "$@" -o "$output"
  sed -i '1i # Made by `make lock` from pyproject.toml; not edited by hand.' "$output"
}

# Without fleet: Ray takes 270 MB, and its tests are skipped where it is missing.
extras=$(for name in embeddings foxglove geo graph mcp parquet rerun store; do echo "--extra $name"; done)
# shellcheck disable=SC2086
pin requirements/dev.txt pyproject.toml requirements/build.in $extras --group dev
pin requirements/bench.txt pyproject.toml requirements/build.in --group bench -c requirements/dev.txt
pin requirements/docs.txt pyproject.toml requirements/build.in --group docs -c requirements/dev.txt
pin requirements/hypermap.txt pyproject.toml requirements/build.in -c requirements/dev.txt
pin requirements/core.txt requirements/core.in -c requirements/dev.txt
pin requirements/node.txt requirements/node.in
pin requirements/audit.txt requirements/audit.in -c requirements/dev.txt
pin requirements/campaign.txt requirements/campaign.in -c requirements/dev.txt
