"""The files of the built page, which are part of the package."""

from __future__ import annotations

from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.viewer.live.request_errors import Refused

PAGE = Path(__file__).resolve().parents[1] / "page"
"""Where the build puts the page."""

_MEDIA_TYPES = {
    "index.html": "text/html; charset=utf-8",
    "app.js": "text/javascript; charset=utf-8",
    "app.css": "text/css; charset=utf-8",
    "run.html": "text/html; charset=utf-8",
    "run.js": "text/javascript; charset=utf-8",
    "run.css": "text/css; charset=utf-8",
    "app.licenses.txt": "text/plain; charset=utf-8",
}


def is_page_built() -> bool:
    """Return whether the page is there; in a checkout it has to be built first."""
    return (PAGE / "index.html").is_file()


def require_page() -> None:
    """Make sure that there is a page to show.

    Raises:
        HypermapError: If it is not built.
    """
    if not is_page_built():
        raise HypermapError(not_built(PAGE))


def page_file(name: str) -> tuple[bytes, str]:
    """Return the content and the media type of one of the page's files.

    Raises:
        Refused: If there is none of that name, or the page is not built.
    """
    if name not in _MEDIA_TYPES:
        raise Refused(f"there is no page {name!r}", 404)
    try:
        return (PAGE / name).read_bytes(), _MEDIA_TYPES[name]
    except FileNotFoundError:
        raise Refused(not_built(PAGE / name), 503) from None


def not_built(path: Path) -> str:
    """Return the error message for a missing file of the page."""
    return f"{path}: the page is not built; build it with: make page"
