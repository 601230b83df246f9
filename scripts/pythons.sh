# Sourced: find_python VERSIONS prints the first Python of these that is here, on PATH or of pyenv.
# None is downloaded. `uv` names the program of that name.
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
