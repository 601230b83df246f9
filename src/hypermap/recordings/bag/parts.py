"""The files that a bag consists of."""

from __future__ import annotations

import re
from pathlib import Path

from hypermap.core.errors import FormatError

ENDINGS = (".bag", ".active", ".db3", ".mcap")  # rosbag calls a bag NAME.bag.active until it ends
_DATE = r"\d{4}(?:-\d\d){5}"
_PART = re.compile(rf"(?P<name>.*?)(?:_?{_DATE})?_(?P<number>\d+)(?P<ending>(?:\.\w+)+)")


def is_ros1_bag(path: Path) -> bool:
    """Return whether a file has a name like the bags of ROS 1."""
    return path.suffix in (".bag", ".active")


def parts_of(path: Path) -> list[Path]:
    """Return the files or folders of a bag, in the order of recording.

    `rosbag record --split` writes NAME_0.bag, NAME_1.bag and so on; with `-o`, each has the date
    of its start before the number. ROS 2 writes parts into a folder, which its metadata describes
    unless the recording was cut off.

    Raises:
        FormatError: If a folder holds no bag, several that are not parts of one, or packed parts
            without metadata.
    """
    metadata = path / "metadata.yaml"
    is_empty = metadata.is_file() and metadata.stat().st_size == 0  # as after a loss of power
    if path.is_file() or (metadata.exists() and not is_empty):
        return [path]
    files = sorted(file for file in path.iterdir() if file.suffix in ENDINGS)
    for packed in sorted(path.glob("*.zstd")):  # by ROS 2, part by part, when each was complete
        if packed.stem.endswith(ENDINGS) and not packed.with_suffix("").exists():
            raise FormatError(
                f"{packed.name} is packed, and there is no metadata.yaml that says so; unpack it "
                "with `zstd -d`",
                path=path,
            )
    if not files:
        raise FormatError("there is an empty metadata.yaml, but no file of a bag", path=path)
    if len(files) == 1:
        return files
    parts = {int(match["number"]): file for file, match in _matches(files)}
    names = {(match["name"], match["ending"].split(".")[1]) for _, match in _matches(files)}
    if len(parts) < len(files) or len(names) > 1:
        listed = ", ".join(file.name for file in files[:4]) + (", ..." if len(files) > 4 else "")
        raise FormatError(
            f"there are {len(files)} bags that are not the parts of one, which would be called "
            f"NAME_0, NAME_1 and so on: {listed}; name one of them",
            path=path,
        )
    return [parts[number] for number in sorted(parts)]


def first_part(path: Path) -> Path | None:
    """Return the first part of a bag, by name, if a file seems to be a later one."""
    own = _PART.fullmatch(path.name) if path.is_file() else None
    if own is None:
        return None
    parts = {
        int(match["number"]): file
        for file, match in _matches(list(path.parent.iterdir()))
        if (match["name"], match["ending"]) == (own["name"], own["ending"])
    }
    first = min(parts)
    return parts[first] if first < int(own["number"]) else None


def _matches(files: list[Path]) -> list[tuple[Path, re.Match[str]]]:
    found = ((file, _PART.fullmatch(file.name)) for file in files)
    return [(file, match) for file, match in found if match is not None]
