"""A color for every class of objects, the same in every map and every picture."""

from __future__ import annotations

import ast
import functools
import re
import zlib
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
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
_PALETTE = "glasbey_bw_minc_20_maxl_70"
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

    To import colorcet is to import matplotlib, which takes a third of a second, and which aborts
    some nodes at their end, when threads still hold objects of it. So the colors are read from its
    file, if they are there.
    """
    found = find_spec("colorcet")
    if found is not None and found.origin is not None:
        text = Path(found.origin).read_text(encoding="utf-8")
        if listed := re.search(rf"^{_PALETTE} = (\[.*?^\])", text, re.MULTILINE | re.DOTALL):
            return tuple(_rounded(*color) for color in ast.literal_eval(listed[1]))
    import colorcet

    return tuple(_rounded(*color) for color in getattr(colorcet, _PALETTE))


def _rounded(red: float, green: float, blue: float) -> Color:
    """Return a color as a page can show it, with 256 steps."""
    return int(red * 255) / 255, int(green * 255) / 255, int(blue * 255) / 255
