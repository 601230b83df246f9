# What scripts share that install packages of Debian, each of which sources this file and defines
# `skip`: it says why nothing is installed and ends the script.

# Whether one of these packages is not installed, or cannot be known to be.
apt_lacks() {
  missing=$(dpkg-query -W -f '${db:Status-Status}\n' "$@" 2>&1 | grep -vcx installed) || true
  [ "${missing:-1}" != 0 ]
}

# Install packages, as root, and say so first.
apt_install() {
  echo "Installing from Debian:" "$@"
  log=$(mktemp)
  trap 'rm -f "$log"' EXIT
  export DEBIAN_FRONTEND=noninteractive
  if ! { apt-get update && apt-get install -y --no-install-recommends "$@"; } >"$log" 2>&1; then
    tail -n 3 "$log" >&2
    skip "apt-get failed, see above"
  fi
}
