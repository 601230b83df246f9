"""The pictures in the documents are there, and small enough to be loaded with a page."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/**/*.md"))]
PICTURE = re.compile(r"!\[([^]]+)\]\(([^)]+)\)")
NAMED = [(page, name) for page in PAGES for _, name in PICTURE.findall(page.read_text("utf-8"))]


@pytest.mark.parametrize(
    ("page", "name"), NAMED, ids=lambda part: part if isinstance(part, str) else part.name
)
def test_a_picture_in_the_documents_is_there_and_small(page: Path, name: str) -> None:
    path = page.parent / name
    assert path.stat().st_size < (1_500_000 if path.suffix == ".webp" else 250_000)  # animated
    with Image.open(path) as image:
        image.verify()


def test_readme_opens_with_the_page_before_it_speaks_of_installing() -> None:
    opening, _, _ = (ROOT / "README.md").read_text("utf-8").partition("## Install")
    shown = [name for _, name in PICTURE.findall(opening) if name.endswith(".png")]
    assert shown == [f"docs/images/{name}.png" for name in ("page", "watching", "evidence")]


def test_the_picture_of_a_growing_map_moves_and_is_small_enough_for_the_top_of_a_page() -> None:
    path = ROOT / "docs/images/growing.webp"
    assert path.stat().st_size < 1_500_000
    with Image.open(path) as image:
        assert image.n_frames >= 20
        assert image.info.get("loop") == 0  # for ever
