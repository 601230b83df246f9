#!/bin/sh
# Install the C++ libraries that the benchmark compares with, on Debian as root; elsewhere say why
# not, and succeed: the benchmark leaves out what is missing.
set -eu

packages="g++ libboost-dev libpcl-dev libpng-dev libyaml-cpp-dev pkg-config"

skip() {
  echo "Peers in C++ are not installed, so the benchmark leaves them out: $1"
  exit 0
}

# shellcheck disable=SC2086 # a list of words
missing=$(dpkg-query -W -f '${db:Status-Status}\n' $packages 2>&1 | grep -vcx installed) || true
[ "${missing:-1}" != 0 ] || exit 0
command -v apt-get >/dev/null || skip "the list of packages is for Debian and its kin"
[ "$(id -u)" = 0 ] || skip "to install them: sudo scripts/peers.sh"

log=$(mktemp)
trap 'rm -f "$log"' EXIT
export DEBIAN_FRONTEND=noninteractive
# shellcheck disable=SC2086 # a list of words
if ! { apt-get update && apt-get install -y --no-install-recommends $packages; } >"$log" 2>&1; then
  tail -n 3 "$log" >&2
  skip "apt-get failed, see above"
fi
