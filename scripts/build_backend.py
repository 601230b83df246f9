"""The build backend of pip and build: setuptools', with the page of `hypermap view` built first.

A wheel or a source archive without the page cannot be made. An editable install needs no page, so
that it stays quick: `make page` builds it. The same sources give the same wheel, byte by byte.
"""

from __future__ import annotations

import os
import re
import stat
import zipfile
from pathlib import Path
from typing import Any

from build_page import PIN, NoNode, PageError, build, find_npm, is_current
from setuptools import build_meta
from setuptools.build_meta import (
    build_editable,
    get_requires_for_build_editable,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

Settings = Any

# When a wheel's files were changed, for those who do not say it by SOURCE_DATE_EPOCH: the first
# moment that a ZIP archive can name.
_EPOCH = "315532800"


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Return what has to be installed to build a wheel."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *_node()]


def get_requires_for_build_sdist(config_settings: Settings = None) -> list[str]:
    """Return what has to be installed to build a source archive."""
    return [*build_meta.get_requires_for_build_sdist(config_settings), *_node()]


def build_wheel(folder: str, config_settings: Settings = None, metadata: str | None = None) -> str:
    """Build the page and a wheel with it, and return the wheel's name."""
    _build_page()
    os.environ.setdefault("SOURCE_DATE_EPOCH", _EPOCH)
    name = build_meta.build_wheel(folder, config_settings, metadata)
    _give_usual_modes(Path(folder) / name)
    return name


def build_sdist(folder: str, config_settings: Settings = None) -> str:
    """Build the page and a source archive with it, and return the archive's name."""
    _build_page()
    return build_meta.build_sdist(folder, config_settings)


def _node() -> list[str]:
    """Return the requirement of a Node.js, if there is a page to build and none is installed."""
    if is_current():
        return []
    try:
        find_npm()
    except NoNode:
        # Without the hashes, which pip takes from files alone.
        return re.findall(r"^[\w.-]+==[\w.]+", PIN.read_text(), re.MULTILINE)
    return []


def _build_page() -> None:
    try:
        build()
    except NoNode as error:
        raise SystemExit(
            f"Hypermap's page is not built, and there is {error}. Install Node.js, or "
            f"`pip install -r {PIN.relative_to(PIN.parents[1])}`, or build without "
            "--no-build-isolation."
        ) from None
    except PageError as error:
        raise SystemExit(f"Hypermap cannot be packed: {error}.") from None


def _give_usual_modes(wheel: Path) -> None:
    """Let everyone read what is in a wheel, whatever the umask with which its sources came."""
    with zipfile.ZipFile(wheel) as archive:
        contents = [(member, archive.read(member)) for member in archive.infolist()]
    with zipfile.ZipFile(wheel, "w") as archive:
        for member, content in contents:
            member.external_attr = (stat.S_IFREG | 0o644) << 16
            archive.writestr(member, content, zipfile.ZIP_DEFLATED)
