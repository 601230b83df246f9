"""A color for every class of objects, the same in every map and every picture."""

from __future__ import annotations

import functools
import zlib
from collections.abc import Iterable
from typing import TypeAlias

Color: TypeAlias = tuple[float, float, float]

# Glasbey's palette is ordered: each color is as far as can be from all before it. So what stands
# in most rooms gets the first colors, written as `_key` writes it.
# fmt: off
_COMMON = (
    "chair", "tv", "pottedplant", "table", "cup", "person", "cupboard", "desk", "keyboard",
    "bottle", "laptop", "book", "couch", "bench", "bed", "sink", "mouse", "bin", "refrigerator",
    "door", "lamp", "diningtable", "backpack", "toilet", "clock", "microwave", "oven", "vase",
    "bowl", "cellphone", "shelf", "bookshelf", "whiteboard", "window", "fan", "cabinet", "remote",
)
# fmt: on
_OTHER_WORDS = {"tvmonitor": "tv", "monitor": "tv", "plant": "pottedplant", "sofa": "couch"}
_OTHERS = 96  # how many of the palette's next colors all other names share


def class_colors(names: Iterable[str]) -> dict[str, Color]:
    """Return a color (red, green, blue in 0..1) for each name, no two alike.

    A name has the same color in every map, except where it falls on a color that is taken: then
    the one later in the alphabet steps aside to the next free color.

    >>> a, b = class_colors(["chair"]), class_colors(["zebra", "chair"])
    >>> a["chair"] == b["chair"] != b["zebra"]
    True
    """
    palette = _palette()
    places: dict[str, int] = {}
    taken: set[int] = set()
    for name in sorted(set(names), key=lambda name: (_key(name) not in _COMMON, name)):
        place = _wanted_place(name)
        while place in taken and len(taken) < len(palette):
            place = (place + 1) % len(palette)
        taken.add(place)
        places[name] = place
    return {name: palette[place] for name, place in places.items()}


def _key(name: str) -> str:
    key = name.lower().replace(" ", "").replace("_", "")
    return _OTHER_WORDS.get(key, key)


def _wanted_place(name: str) -> int:
    key = _key(name)
    if key in _COMMON:
        return _COMMON.index(key)
    return len(_COMMON) + zlib.crc32(key.encode()) % _OTHERS


@functools.cache
def _palette() -> tuple[Color, ...]:
    """Return 256 colors that keep apart from each other, from white and from black.

    Source: Glasbey et al., "Colour displays for categorical images", 2007; computed by colorcet
    with lightness up to 70 and chroma from 20, so that no color is lost on a map's white and gray.
    """
    import colorcet

    return tuple(_rgb(text) for text in colorcet.b_glasbey_bw_minc_20_maxl_70)


def _rgb(text: str) -> Color:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red / 255, green / 255, blue / 255
