"""Pictures and other files: attached to notes, crops of objects, and images of cameras."""

from __future__ import annotations

import contextlib
import io
import random
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from campaign.fuzz_targets.target import Target
from campaign.mutation import mutate_any, mutate_text
from hypermap import HypermapError
from hypermap.core.pictures import START_OF_JPEG, ObjectPicture
from hypermap.notes import as_html, attachment_of_bytes
from hypermap.recordings.pictures import decode_color, decode_integers, picture_size
from hypermap.viewer.live.attached import file_reply
from hypermap.viewer.object_pictures import image_of

_MARKDOWN = b"""# A <b onclick="x()">
[b](http://c "t") ![p](https://x/y.png) [j](javascript:alert(1)) <javascript:x> <https://ok/>
[d]: data:text/html,<script>x</script> "t"
[d] | `c` | &lt;script&gt; &#106;avascript: \\<i> *e* **s**

| a | b |
|:-:|--:|
| <!-- x --> | [r][d] |

> - 1. ```js"><script>
"""
_HARMFUL = ("html", "svg", "xml", "script")


def media(_: Path) -> Target:
    """A file that somebody attaches: its name in the first line, and its content."""

    def ask(data: bytes) -> None:
        name, _, content = data.partition(b"\n")
        _attach(content, name.decode(errors="surrogateescape"))
        reader = _Inert()
        reader.feed(as_html(content[:4096].decode(errors="replace")))
        reader.close()

    return Target(ask, [f"{name}\n".encode() + content for name, content in _files()], _mutate_file)


class _Inert(HTMLParser):
    """Reads HTML that may hold nothing but words, tables and links to web pages."""

    _TAGS = frozenset(
        [
            *("p", "br", "hr", "em", "strong", "code", "pre", "blockquote", "a", "ul", "ol", "li"),
            *("table", "thead", "tbody", "tr", "th", "td", "h1", "h2", "h3", "h4", "h5", "h6"),
        ]
    )
    _ATTRIBUTES = frozenset(["href", "title", "target", "rel", "class", "start", "style"])

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Look at a tag and its attributes."""
        if tag not in self._TAGS:
            raise AssertionError(f"a text became a <{tag}>")
        for name, value in attrs:
            is_link = not value or value.startswith(("http://", "https://"))  # or leads nowhere
            if name not in self._ATTRIBUTES or (name == "href" and not is_link):
                raise AssertionError(f"a text became {name}={value!r}")
            if name == "style" and not re.fullmatch("text-align:(left|center|right)", value or ""):
                raise AssertionError(f"a text became a style: {value!r}")

    def handle_decl(self, decl: str) -> None:
        """Refuse what no text is."""
        raise AssertionError(f"a text became <!{decl}>")

    def handle_comment(self, data: str) -> None:
        """Refuse what no text is."""
        raise AssertionError(f"a text became <!--{data}-->")


def images(_: Path) -> Target:
    """A picture, as somebody attaches it, as the crop of an object and as a camera's image."""

    def ask(data: bytes) -> None:
        for read in (decode_color, decode_integers, picture_size, _attach, _as_crop):
            with contextlib.suppress(HypermapError):
                read(data)

    return Target(ask, list(_images()), mutate_any)


def _attach(content: bytes, name: str = "tile.png") -> None:
    """Attach a file, and look at how it would be sent to a browser."""
    reply = file_reply(attachment_of_bytes(content, name))
    kind = reply.headers["content-type"]
    if any(word in kind for word in _HARMFUL):
        raise AssertionError(f"is sent as {kind}")
    if "sandbox" not in reply.headers["content-security-policy"]:
        raise AssertionError("is sent as a page")


def _as_crop(content: bytes) -> None:
    if content.startswith(START_OF_JPEG):
        image_of(ObjectPicture(content, 0.0, 0.0, 0.5, 0.0))


def _images() -> Iterator[bytes]:
    colors = np.random.default_rng(1).integers(0, 256, (18, 24, 3), np.uint8)
    picture, depth = Image.fromarray(colors), Image.fromarray(np.arange(48, dtype=np.uint16) * 900)
    still: dict[str, list[dict[str, Any]]] = {
        "JPEG": [{}, {"progressive": True}, {"exif": b"Exif\0\0II*\0\x08\0\0\0\0\0"}],
        "WEBP": [{}, {"lossless": True}],
        "GIF": [{}],
        "PNG": [{}],
    }
    for kind, options in still.items():
        for given in options:
            written = io.BytesIO()
            picture.save(written, kind, **given)
            yield written.getvalue()
    for kind in ("GIF", "WEBP", "PNG"):  # that move
        written = io.BytesIO()
        picture.save(written, kind, save_all=True, append_images=[picture.rotate(90)] * 3)
        yield written.getvalue()
    for mode in ("CMYK", "L"):
        written = io.BytesIO()
        picture.convert(mode).save(written, "JPEG")
        yield written.getvalue()
    written = io.BytesIO()
    depth.save(written, "PNG")
    yield written.getvalue()
    yield b"<?xml version='1.0'?><svg xmlns='http://www.w3.org/2000/svg' onload='alert(1)'/>"
    yield b"GIF89a/*<svg onload=alert(1)>*/=1;alert(1)//<script>alert(1)</script>"


def _files() -> list[tuple[str, bytes]]:
    gray = Image.fromarray(np.arange(48, dtype=np.uint8).reshape(6, 8) * 5)
    files = [("plan.svg", b"<svg onload='alert(1)'></svg>"), ("x.md", _MARKDOWN)]
    for kind in ("PNG", "JPEG", "GIF", "WEBP"):
        written = io.BytesIO()
        gray.save(written, kind)
        files.append((f"a.{kind.lower()}", written.getvalue()))
    files.append(("a.wav", b"RIFF\x24\0\0\0WAVEfmt " + bytes(24)))
    files.append(("a.mp4", b"\0\0\0\x18ftypisom" + bytes(24)))
    return files


def _mutate_file(data: bytes, draw: random.Random) -> bytes:
    name, mark, content = data.partition(b"\n")
    if draw.random() < 0.15:
        return mutate_text(name, draw) + mark + content
    return name + mark + mutate_any(content, draw)
