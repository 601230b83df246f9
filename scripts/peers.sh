#!/bin/sh
# Install the C++ libraries that the benchmark compares with, on Debian as root; elsewhere say why
# not, and succeed: the benchmark leaves out what is missing.
set -eu
. "$(dirname "$0")/apt.sh"

packages="g++ libboost-dev libpcl-dev libpng-dev libyaml-cpp-dev pkg-config"

skip() {
  echo "Peers in C++ are not installed, so the benchmark leaves them out: $1"
  exit 0
}

# shellcheck disable=SC2086 # a list of words
apt_lacks $packages || exit 0
command -v apt-get >/dev/null || skip "the list of packages is for Debian and its kin"
[ "$(id -u)" = 0 ] || skip "to install them: sudo scripts/peers.sh"
# shellcheck disable=SC2086
apt_install $packages
