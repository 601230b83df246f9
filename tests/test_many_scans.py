"""A JPEG file of very many scans is small and takes minutes to decode, so nobody decodes it."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from PIL import Image

from hypermap import HypermapError
from hypermap.core.pictures import MOST_SCANS, scans_of
from hypermap.formats.grid.pictures import decode_gray
from hypermap.notes import attachment_of_bytes
from hypermap.recordings.pictures import decode_color, picture_size
from hypermap.testing import jpeg_picture
from hypermap.viewer.object_pictures import image_of


def progressive(scans: int) -> bytes:
    """Return a JPEG file whose last scan is there again and again."""
    file = io.BytesIO()
    Image.linear_gradient("L").save(file, "JPEG", progressive=True)
    content = file.getvalue()
    last = content.rindex(b"\xff\xda")
    more = scans - scans_of(content)
    return content[:last] + (more + 1) * content[last:-2] + content[-2:]


@pytest.mark.parametrize(
    "decode",
    [
        lambda jpeg: list(decode_gray(jpeg, "map.jpg")),
        lambda jpeg: attachment_of_bytes(jpeg, "tile.jpg"),
        decode_color,
        picture_size,
        lambda jpeg: image_of(replace(jpeg_picture(), jpeg=jpeg)),
    ],
    ids=["map", "note", "frame", "size", "crop"],
)
def test_a_picture_of_too_many_scans_is_refused(decode: Callable[[bytes], Any]) -> None:
    decode(progressive(MOST_SCANS))
    with pytest.raises(HypermapError, match=f"{MOST_SCANS + 1} scans|more than {MOST_SCANS} scans"):
        decode(progressive(MOST_SCANS + 1))
