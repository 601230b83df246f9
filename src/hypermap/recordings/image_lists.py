"""The lists of images in folders of the TUM RGB-D benchmark."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.stamps import in_seconds
from hypermap.recordings.textfiles import finite_numbers, read_lines


@dataclass(frozen=True, eq=False)
class ImageList:
    """Images and when they were taken.

    Attributes:
        stamps: seconds, shape (N,).
        paths: the image files, N of them.
    """

    stamps: NDArray[np.float64]
    paths: list[Path]


def read_image_list(path: Path) -> ImageList:
    """Return the images that a list names, in the list's order.

    A line is a stamp and a file name, with space or a comma between them, as in EuRoC's lists.

    Raises:
        FileMissing: If there is no list.
        FormatError: If a line is not a stamp and a file name, or there is none.
    """
    stamps, paths = [], []
    for key, text in read_lines(path):
        stamp, *name = re.split(r"\s*,\s*|\s+", text, maxsplit=1)
        if not name:
            raise FormatError(
                f"expected a stamp and a file name, found {text!r}", path=path, key=key
            )
        stamps.append(finite_numbers([stamp], path, key)[0])
        paths.append(path.parent / name[0])
    if not stamps:
        raise FormatError("the list is empty", path=path)
    return ImageList(in_seconds(np.array(stamps)), paths)


def read_associations(path: Path) -> tuple[ImageList, ImageList]:
    """Return the depth and the color images in a list of pairs.

    The name says which image of a pair is the depth: some tools write it first, others second.

    Raises:
        FormatError: If a line is not two stamps with a file each, one called depth, or there is
            none.
    """
    depth: list[tuple[float, Path]] = []
    color: list[tuple[float, Path]] = []
    for key, text in read_lines(path):
        words = text.split()
        pairs = sorted(zip(words[::2], words[1::2], strict=False), key=lambda p: "depth" in p[1])
        if len(words) != 4 or ["depth" in name for _, name in pairs] != [False, True]:
            raise FormatError(
                f"expected stamp, file, stamp, file, with one file named depth, found {text!r}",
                path=path,
                key=key,
            )
        for images, (stamp, name) in zip((color, depth), pairs, strict=True):
            images.append((finite_numbers([stamp], path, key)[0], path.parent / name))
    if not depth:
        raise FormatError("the list is empty", path=path)
    return _image_list(depth), _image_list(color)


def _image_list(images: list[tuple[float, Path]]) -> ImageList:
    stamps = in_seconds(np.array([stamp for stamp, _ in images]))
    return ImageList(stamps, [path for _, path in images])
