#!/bin/sh
# Build the source archive and from it the wheel, as from a fresh clone at a tag: without a page, with
# the backend's own requirements. Run the command from that, away from the checkout. Build the wheel
# once more, elsewhere: without git, from newer files and with another umask. It must be the same,
# byte by byte.
set -eu
cd "$(dirname "$0")/.."
python=$PWD/${VENV:-.venv}/bin/python
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/clone"
git ls-files -z --cached --others --exclude-standard | tar -c --null -T - | tar -x -C "$work/clone"
(
  cd "$work/clone"
  git init --quiet && git add .
  git -c user.name=check -c user.email=check@example.com commit --quiet --message "As it is now"
  git tag v12.3.4
)
"$python" -m build --quiet --outdir "$work/dist" "$work/clone" >/dev/null
mkdir "$work/once-more"
(
  umask 077
  tar -xz --no-same-permissions --strip-components 1 -C "$work/once-more" -f "$work"/dist/*.tar.gz
  rm -r "$work/once-more/src/hypermap/viewer/page"
  cp -R "$work/clone/page/node_modules" "$work/once-more/page"  # npm need not install them again
  "$python" -m build --quiet --wheel --outdir "$work/once-more/dist" "$work/once-more" >/dev/null
)
cmp "$work"/dist/*.whl "$work"/once-more/dist/*.whl
"$python" -m pip install --quiet --disable-pip-version-check --no-deps --target "$work/site" "$work"/dist/*.whl
cd "$work"
PYTHONPATH=$work/site "$python" -c '
import hypermap
from pathlib import Path
package = Path(hypermap.__file__).parent
assert package.parent.name == "site", package
assert hypermap.__version__ == "12.3.4", hypermap.__version__
messages = (f"ros/hypermap_msgs/{name}" for name in ("msg/SemanticMap.msg", "srv/LoadMap.srv"))
names = ("index.html", "app.js", "app.css", "run.html", "run.js", "run.css", "app.licenses.txt")
page = (f"viewer/page/{name}" for name in names)
for file in ("py.typed", "simulation/worlds/demo.yaml", "simulation/detector.onnx", *messages, *page):
    assert (package / file).is_file(), f"the wheel lacks {file}"
from hypermap.ros.definitions import package_folder
assert package_folder() == package / "ros" / "hypermap_msgs", package_folder()
'
PYTHONPATH=$work/site "$python" -m hypermap --version
