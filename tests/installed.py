"""Packages with plug-ins, as pip would leave them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


def install_package(
    folder: Path, name: str, group: str, points: Mapping[str, str], version: str = "1.0"
) -> None:
    """Install a package that registers plug-ins; its modules are files in the folder.

    Args:
        folder: on the path of modules.
        name: of the package.
        group: of the entry points.
        points: what each of them names, as in `{"boxes": "my_package:Boxes"}`.
        version: of the package.
    """
    metadata = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = "".join(f"{point} = {value}\n" for point, value in points.items())
    (metadata / "entry_points.txt").write_text(f"[{group}]\n{lines}")
