"""The documentation builds as a site: every link and anchor leads somewhere, here and offline."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import hypermap

if sys.version_info < (3, 11):
    pytest.skip("the site is built with Python 3.11 or newer", allow_module_level=True)
mkdocs = pytest.importorskip("mkdocs", reason="MkDocs is not installed (make docs)")

ROOT = Path(__file__).resolve().parents[2]


class Loaded(HTMLParser):
    """Collects what a browser loads by itself to show a page."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "link" and given.get("rel") in ("canonical", "prev", "next"):
            return
        name = {"link": "href", "script": "src", "img": "src", "iframe": "src"}.get(tag)
        if name and given.get(name):
            self.addresses.append(str(given[name]))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built once; its notebooks are shown as they stand, as other tests run them."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)],
        cwd=ROOT,
        env={**os.environ, "HYPERMAP_NOTEBOOKS": "show", "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.xdist_group("site")
def test_the_site_shows_every_document_name_and_command(site: Path) -> None:
    for page in (ROOT / "docs").rglob("*.md"):
        assert (site / "docs" / page.relative_to(ROOT / "docs")).with_suffix(".html").exists()
    reference = (site / "reference/python/hypermap.html").read_text(encoding="utf-8")
    names = set(hypermap.__all__) - {"__version__"}
    assert not {name for name in names if f'id="hypermap.{name}"' not in reference}
    assert "&gt;&gt;&gt;" in reference
    assert "<blockquote>" not in reference  # which prompts of examples would be, were they no code

    commands = (site / "reference/commands.html").read_text(encoding="utf-8")
    shown = set(re.findall(r'<h2 id="([\w-]+)"', commands))
    help_text = subprocess.run(
        [sys.executable, "-m", "hypermap", "--help"], capture_output=True, text=True, check=True
    ).stdout
    listed = set(re.findall(r"^│ ([a-z][\w-]*)  ", help_text, re.MULTILINE))
    assert {"map", "query", "serve"} <= listed <= shown
    assert "<code>--within " in commands


@pytest.mark.xdist_group("site")
def test_the_site_needs_no_network_and_no_server(site: Path) -> None:
    pages = list(site.rglob("*.html"))
    assert len(pages) > 60
    for page in pages:
        for address in Loaded(page).addresses:
            if address.startswith("data:"):
                continue
            assert not re.match(r"([a-z]+:)?//", address), f"{page}: {address}"
            name = re.split(r"[?#]", address)[0]
            if page.name != "404.html":  # which has to name its files from the root of a server
                assert (page.parent / name).exists(), f"{page}: {address}"


def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/index.md").write_text("[gone](gone.md) and [lost](#lost)\n")
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    validation = re.search(r"^validation:\n(?:  .*\n)+", settings, re.MULTILINE)
    assert validation
    (tmp_path / "mkdocs.yml").write_text(f"site_name: x\nstrict: true\n{validation[0]}")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert "'gone.md'" in done.stderr
    assert "'#lost'" in done.stderr
