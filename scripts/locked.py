"""Reads what `make lock` wrote: which packages are pinned, for which computers, by which hashes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Pin:
    """One package that the requirements pin.

    Attributes:
        name: in lower case, with hyphens.
        version: the only one that may be installed.
        extras: what other packages want of it besides its core.
        marker: on which computers and Pythons, as in PEP 508; empty for all.
        hashes: SHA-256 of the files that may be installed, in hexadecimal.
    """

    name: str
    version: str
    extras: frozenset[str]
    marker: str
    hashes: tuple[str, ...]


def read_pins(requirements: Path) -> list[Pin]:
    """Return what a file of pinned requirements holds, in its order."""
    lines = requirements.read_text().replace("\\\n", " ").splitlines()
    return [_pin(line) for line in lines if line and not line.startswith("#")]


def _pin(line: str) -> Pin:
    stated, *hashes = re.split(r"\s+--hash=sha256:", line)
    requirement = Requirement(stated)
    (version,) = requirement.specifier
    return Pin(
        name=requirement.name,
        version=version.version,
        extras=frozenset(requirement.extras),
        marker=str(requirement.marker or ""),
        hashes=tuple(text.strip() for text in hashes),
    )


def read_licenses(file: Path) -> dict[str, str]:
    """Return the SPDX expression of each package that the list names."""
    lines = (line.split("#")[0].split(maxsplit=1) for line in file.read_text().splitlines())
    return {words[0]: words[1].strip() for words in lines if words}
