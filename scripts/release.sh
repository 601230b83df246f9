#!/bin/sh
# The steps of a release, as docs/release.md lists them: scripts/release.sh check TAG | build | install
#   check TAG  whether the checkout matches the tag: version, changelog, ROS packages, addresses
#   build      source archive and wheel into dist/, and what the registry would say of them
#   install    both, in new environments of the oldest and the newest Python that are here
set -eu
cd "$(dirname "$0")/.."
. scripts/uv.sh
python=$PWD/${VENV:-.venv}/bin/python

refuse() {
  echo "not released: $*" >&2
  exit 1
}

check() {
  tag=${1:?the tag is missing: scripts/release.sh check v1.2.3}
  version=${tag#v}
  [ "v$version" = "$tag" ] || refuse "the tag $tag does not begin with v"
  [ -z "$(git status --porcelain)" ] || refuse "there are changes that are not committed"
  grep -qE "^## $version \([0-9]{4}-[0-9]{2}-[0-9]{2}\)" CHANGELOG.md ||
    refuse "CHANGELOG.md has no heading '## $version (YEAR-MONTH-DAY)'"
  for package in ros/*/package.xml; do
    grep -q "<version>$version</version>" "$package" || refuse "$package has another version"
    ! grep -q "@example.com" "$package" || refuse "$package names no maintainer yet"
  done
  grep -q "^\[project.urls\]" pyproject.toml || refuse "pyproject.toml has no [project.urls] yet"
  is=$("$python" -m setuptools_scm)
  [ "$is" = "$version" ] || refuse "git's tags make this version $is; is $tag a tag of this commit?"
  echo "$tag: ready to be built"
}

build() {
  rm -rf dist
  SOURCE_DATE_EPOCH=$(git log -1 --format=%ct) "$python" -m build --quiet --outdir dist .
  "$uv" tool run --quiet --from twine==6.2.0 twine check --strict dist/*
  "$uv" tool run --quiet check-wheel-contents==0.6.3 dist/*.whl
  ls -l dist
}

install() {
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
  for python in $(find_python $OLDEST_FIRST) $(find_python $NEWEST_FIRST); do
    for archive in "$PWD"/dist/*.whl "$PWD"/dist/*.tar.gz; do
      echo "$("$python" --version), ${archive##*/}:"
      rm -rf "$work/venv"
      "$python" -m venv "$work/venv"
      "$work/venv/bin/pip" install --quiet --disable-pip-version-check "$archive"
      (cd "$work" && venv/bin/hypermap --version && venv/bin/hypermap simulate demo -o drive --rate 0.1 &&
        venv/bin/hypermap map drive --detections drive/detections.json -o room.hmap &&
        venv/bin/hypermap view room.hmap --html room.html)
      rm -rf "$work"/drive* "$work"/room*
    done
  done
}

step=${1:-}
case $step in
  check | build | install) shift && "$step" "$@" ;;
  *) sed -n '2,5s/^# //p' "$0" && exit 2 ;;
esac
