# Sourced in the checkout: uv, and what finds Pythons by it.
uv=$PWD/${VENV:-.venv}/bin/uv
# Where its cache cannot be made, as in a home folder that is write-protected, it ends.
mkdir -p "$("$uv" cache dir)" 2>/dev/null || export UV_CACHE_DIR="$PWD/${VENV:-.venv}/uv-cache"

# find_python VERSIONS... prints the first of these that is here, on PATH or of pyenv. None is
# downloaded.
find_python() {
  for version in "$@"; do
    python=$("$uv" python find --quiet --no-project --no-python-downloads "$version" 2>/dev/null) ||
      python=$(ls -d "${PYENV_ROOT:-$HOME/.pyenv}/versions/$version".*/bin/python 2>/dev/null | tail -n 1)
    if [ -n "$python" ]; then
      echo "$python"
      return
    fi
  done
}

OLDEST_FIRST="3.10 3.11 3.12"
NEWEST_FIRST="3.14 3.13 3.12 3.11"
