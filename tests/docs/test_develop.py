"""The developer's guide names files that exist, and few of them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs/develop.md").read_text(encoding="utf-8")
LISTS = re.findall(r"^## (.+?)$(.*?)(?=^## |\Z)", GUIDE, re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("title", "text"), LISTS, ids=[title for title, _ in LISTS])
def test_what_can_be_added_touches_at_most_four_files_which_exist(title: str, text: str) -> None:
    rows = re.findall(r"^\| `([^`]+)`", text, re.MULTILINE)
    assert 1 <= len(rows) <= 4
    for path in rows + re.findall(r"`((?:src|tests|docs|ros|scripts)/[^`]+)`", text):
        assert (ROOT / path).exists(), f"{title}: {path}"


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("src/hypermap/console/options.py", "OPTIONS"),
        ("src/hypermap/questions/answer.py", "_found"),
        ("src/hypermap/console/questions.py", "query_of"),
        ("src/hypermap/questions/query.py", "describes_objects"),
        ("src/hypermap/console/questions.py", "_check"),
        ("src/hypermap/formats/plugins.py", "_OURS"),
        ("src/hypermap/__init__.py", "_HOMES"),
        ("src/hypermap/cli/main.py", "_MODULES"),
    ],
)
def test_the_guide_names_what_is_in_those_files(path: str, name: str) -> None:
    assert f"`{name}`" in GUIDE
    assert re.search(rf"\b{name}\b", (ROOT / path).read_text(encoding="utf-8"))
