"""The pictures of the objects of an answer, for `--pictures`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from hypermap.console.questions import Row
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats.atomic import make_folder, write_files


def write_pictures(hypermap: Hypermap, rows: Sequence[Row], folder: Path) -> int:
    """Save the pictures of the objects of an answer, and return how many there are.

    Each row of an object gets the key `pictures`: the paths, best first. Files are named by layer,
    class, id and number, as `semantic_cup_7_1.jpg`; those from an earlier call are replaced.

    Args:
        hypermap: the map.
        rows: the answer.
        folder: where to; it is made if it is not there.

    Raises:
        HypermapError: If there are rows, but none is of an object, or a file cannot be written.
    """
    objects = [row for row in rows if "object" in row]
    if rows and not objects:
        raise HypermapError("--pictures saves pictures of objects; choose some with --name or --id")
    files: dict[str, bytes] = {}
    for row in objects:
        layer, number = hypermap[row["layer"]], row["object"]["id"]
        row["pictures"] = []
        if not isinstance(layer, SemanticLayer):
            continue
        stem = "_".join(re.sub(r"\W+", "-", word)[:30] for word in (layer.name, str(row["label"])))
        for rank, picture in enumerate(layer.pictures(number), start=1):
            name = f"{stem}_{number}_{rank}.jpg"
            files[name] = picture.jpeg
            row["pictures"].append(str(folder / name))
    if files:
        make_folder(folder)
        write_files(folder, files)
    return len(files)
