"""The page of a report: one HTML file that needs no other file and no network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Iterable

from matplotlib import rc_context
from matplotlib.figure import Figure

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 76em; margin: 2em auto; padding: 0 1em;
       color: #1d2129; }
h1, h2 { font-weight: 650; } h2 { margin-top: 2.5em; border-bottom: 1px solid #ccd; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
caption { text-align: left; color: #556; padding: .3em 0; }
th, td { padding: .25em .8em; text-align: right; }
th:first-child, td:first-child { text-align: left; }
td { white-space: nowrap; }
thead th { border-bottom: 2px solid #556; vertical-align: bottom; }
tbody tr:nth-child(even) { background: #f3f5f8; }
tr.ours td { font-weight: 650; }
.bar { display: inline-block; height: .8em; background: #3573b9; vertical-align: middle;
       margin-right: .5em; }
.note { color: #556; } img { max-width: 100%; }
.wide { overflow-x: auto; } details { margin: 1em 0; } summary { cursor: pointer; }
figure { margin: 1em 0; } figcaption { color: #556; }
@media (prefers-color-scheme: dark) { body { background: #16181d; color: #dde1e8; }
  tbody tr:nth-child(even) { background: #20242c; }
  .note, figcaption, caption { color: #9aa4b2; } }
"""


def page_of(title: str, parts: Iterable[str]) -> bytes:
    """Return a page.

    Args:
        title: in the browser's tab.
        parts: HTML, from top to bottom.
    """
    return (
        "<!doctype html><html lang=en><meta charset=utf-8>"
        f"<title>Hypermap: {html.escape(title)}</title><style>{_STYLE}</style>"
        f"<body>{''.join(parts)}</body></html>"
    ).encode(errors="backslashreplace")  # names of files need not be valid Unicode


def wide(content: str) -> str:
    """Return HTML that scrolls sideways where the window is too narrow for it."""
    return f"<div class=wide>{content}</div>"


def folded(title: str, content: str) -> str:
    """Return HTML that is shown when its title is clicked."""
    return f"<details><summary>{html.escape(title)}</summary>{content}</details>"


def picture_of(content: bytes, kind: str, caption: str) -> str:
    """Return a picture as HTML.

    Args:
        content: of the file.
        kind: of file, as in "png" or "svg+xml".
        caption: what it shows.
    """
    data = base64.b64encode(content).decode()
    text = html.escape(caption)
    return (
        f'<figure><img alt="{text}" src="data:image/{kind};base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def plot_of(figure: Figure, caption: str) -> str:
    """Return a plot as HTML; the same plot gives the same bytes."""
    content = io.BytesIO()
    with rc_context({"svg.hashsalt": "hypermap", "svg.fonttype": "none"}):
        figure.savefig(content, format="svg", metadata={"Date": None}, bbox_inches="tight")
    return picture_of(content.getvalue(), "svg+xml", caption)
