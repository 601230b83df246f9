#!/bin/sh
# Build the page that `hypermap view` opens, into src/hypermap/viewer/page: scripts/page.sh
# With "check" it is only checked: types, format, and the tests of what needs no browser.
set -eu
cd "$(dirname "$0")/../page"
if ! command -v npm >/dev/null ||
  ! node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)'; then
  echo "The page of hypermap view is built with Node.js 20 or newer and npm. Install both (on" >&2
  echo "Debian 13: sudo apt-get install nodejs npm) and run make again." >&2
  exit 1
fi
if ! [ node_modules/.package-lock.json -nt package-lock.json ]; then
  npm ci --loglevel=error
fi
npm run --silent "${1:-build}"
