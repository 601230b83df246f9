#!/bin/sh
# Install Chromium for the tests of the page, on Debian as root; elsewhere say why not, and succeed.
set -eu
. "$(dirname "$0")/apt.sh"

skip() {
  echo "Chromium is not installed, so the tests of the page are skipped: $1"
  exit 0
}

[ -z "${HYPERMAP_CHROMIUM:-}" ] || exit 0
for program in chromium-headless-shell chromium; do
  [ ! -x "/usr/bin/$program" ] || exit 0
done
grep -qsx 'ID=debian' /etc/os-release || skip "name yours, as HYPERMAP_CHROMIUM=/usr/bin/chromium-browser"
[ "$(id -u)" = 0 ] || skip "to install it: sudo scripts/chromium.sh"
# Without its windows, which no test sees, it is smaller and takes two thirds of the processor time.
apt_install chromium-headless-shell
