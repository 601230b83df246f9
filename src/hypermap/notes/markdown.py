"""Texts of notes as HTML that is safe to show on a page.

Whoever can leave a note must not be able to run a program at, or call home from, whoever reads it.
So HTML in a text is shown as text, pictures from elsewhere are links, and links lead only to web
pages.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from markdown_it import MarkdownIt

_NESTED = 20  # lists in lists; deeper ones are shown flat


def as_html(text: str) -> str:
    r"""Return Markdown (CommonMark with tables) as HTML.

    >>> as_html("**Wet** floor <script>alert(1)</script>")
    '<p><strong>Wet</strong> floor &lt;script&gt;alert(1)&lt;/script&gt;</p>\n'
    >>> as_html("[here](javascript:alert(1))")
    '<p>[here](javascript:alert(1))</p>\n'
    """
    html: str = _parser().render(text)
    return html


def _parser() -> MarkdownIt:
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False, "maxNesting": _NESTED})
    parser.enable("table").disable("image")
    parser.validateLink = _is_web_address  # type: ignore[method-assign]  # as its documents say
    parser.add_render_rule("link_open", _link_open)
    return parser


def _is_web_address(url: str) -> bool:
    return url.startswith(("http://", "https://"))


def _link_open(renderer: Any, tokens: Any, index: int, options: Any, env: Any) -> str:
    """Open a link in a window of its own, which learns nothing of ours."""
    tokens[index].attrSet("target", "_blank")
    tokens[index].attrSet("rel", "noopener noreferrer nofollow")
    opened: str = renderer.renderToken(tokens, index, options, env)
    return opened
