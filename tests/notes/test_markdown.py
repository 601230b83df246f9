"""Whatever a note says, the page runs nothing of it and asks nobody else."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.notes import as_html

# Tags that Markdown makes, with attributes of ours alone
ALLOWED = re.compile(
    r"</?(?:p|strong|em|code|pre|ul|ol|li|h[1-6]|blockquote|table|thead|tbody|tr|th|td|a)>"
    r"|<(?:br|hr) />|<ol start=\"\d+\">|<code class=\"language-[^\"<>]*\">"
    r"|<t[hd] style=\"text-align:(?:left|right|center)\">"
    r"|<a href=\"https?://[^\"<>]*\"(?: title=\"[^\"<>]*\")? target=\"_blank\" "
    r"rel=\"noopener noreferrer nofollow\">"
)

ATTACKS = [
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "<svg/onload=alert(1)>",
    "[a](javascript:alert(1))",
    "[a](JaVaScRiPt:alert(1))",
    "[a](java&#115;cript:alert(1))",
    "[a](\x01javascript:alert(1))",
    "<javascript:alert(1)>",
    "[a](data:text/html,<script>)",
    "[a](file:///etc/passwd)",
    "[a](/api/save)",
    '[a](https://x.org "t\\" onclick=\\"alert(1)")',
    "![track](https://evil.example/pixel.png)",
    '<a href="https://x.org" onclick="alert(1)">a</a>',
    "```html onclick=x\n<script>\n```",
    '``` "><script>\nx\n```',
    "| a |\n|---|\n| <script> |",
    "[x]: javascript:alert(1)\n\n[x]",
    "> " * 200 + "deep",
    "[" * 500,
]


def rest(html: str) -> str:
    """Return what of a page is neither text nor a tag that may be there."""
    return re.sub(r"[^<>]", "", ALLOWED.sub("", html))


@pytest.mark.parametrize("text", ATTACKS)
def test_an_attack_is_shown_as_text(text):
    html = as_html(text)
    assert rest(html) == "", html
    assert "<img" not in html


@given(st.text(alphabet="<>&\"'[]()!`*_#|-:/ \nahrefjscript=x", max_size=60))
def test_any_text_makes_only_tags_of_markdown(text):
    assert rest(as_html(text)) == ""


def test_markdown_is_shown_as_such():
    html = as_html("# Pump\n\n- *hot* **now**\n\n| a | b |\n|---|--:|\n| 1 | 2 |")
    for part in ("<h1>Pump</h1>", "<em>hot</em>", "<strong>now</strong>", "<td>1</td>"):
        assert part in html
    link = as_html("[manual](https://example.org/a?b=1&c)")
    assert 'href="https://example.org/a?b=1&amp;c"' in link
    assert 'target="_blank" rel="noopener noreferrer nofollow"' in link
