#!/bin/sh
# Install Chromium for the tests of the page, on Debian as root; elsewhere say why not, and succeed.
set -eu
. "$(dirname "$0")/apt.sh"

skip() {
  echo "Chromium is not installed, so the tests of the page are skipped: $1"
  exit 0
}

[ -z "${HYPERMAP_CHROMIUM:-}" ] || exit 0
[ ! -x /usr/bin/chromium ] || exit 0
grep -qsx 'ID=debian' /etc/os-release || skip "name yours, as HYPERMAP_CHROMIUM=/usr/bin/chromium-browser"
[ "$(id -u)" = 0 ] || skip "to install it: sudo scripts/chromium.sh"
apt_install chromium
