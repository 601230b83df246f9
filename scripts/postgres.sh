#!/bin/sh
# Install PostgreSQL 15 with PostGIS from Debian 12, as root; elsewhere say why not, and succeed.
# No server is left running: the tests start one of their own.
set -eu
. "$(dirname "$0")/apt.sh"

packages="postgresql-15-postgis-3"

skip() {
  echo "PostgreSQL is not installed, so its tests are skipped: $1"
  exit 0
}

# shellcheck disable=SC2086 # a list of words
apt_lacks $packages || exit 0
grep -qsx 'VERSION_CODENAME=bookworm' /etc/os-release || skip "version 15 comes from Debian 12"
[ "$(id -u)" = 0 ] || skip "to install it: sudo scripts/postgres.sh"
# else the package makes a server of its own, which nobody needs here
mkdir -p /etc/postgresql-common
[ -e /etc/postgresql-common/createcluster.conf ] ||
  echo 'create_main_cluster = false' >/etc/postgresql-common/createcluster.conf
# shellcheck disable=SC2086
apt_install $packages
