"""Builds the peers that are C++ programs, and runs them."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from suite.race import Settings, Unavailable

PEERS = Path(__file__).resolve().parent.parent


def build(
    source: str, packages: Sequence[str], settings: Settings, for_this_machine: bool = True
) -> Path:
    """Compile `benchmarks/SOURCE` unless that was done already, and return the program.

    Args:
        source: as "boost/rtree.cpp".
        packages: names of the libraries for pkg-config, as "yaml-cpp".
        settings: where compiled programs go.
        for_this_machine: whether the compiler may use all that this processor has. Not when
            compared with a library whose classes are laid out differently then, as PCL's are.

    Raises:
        Unavailable: If there is no compiler or a library is missing.
        subprocess.CalledProcessError: If the program does not compile.
    """
    path = PEERS / source
    program = settings.build / path.stem
    if program.exists() and program.stat().st_mtime > path.stat().st_mtime:
        return program
    for tool in ("g++", "pkg-config"):
        if shutil.which(tool) is None:
            raise Unavailable(f"{tool} is missing; on Debian: scripts/peers.sh")
    flags: list[str] = []
    for package in packages:
        asked = ["pkg-config", "--cflags", "--libs", package]
        answer = subprocess.run(asked, capture_output=True, text=True, check=False)
        if answer.returncode:
            raise Unavailable(f"the C++ library {package} is missing; on Debian: scripts/peers.sh")
        flags += answer.stdout.split()
    settings.build.mkdir(parents=True, exist_ok=True)
    command = ["g++", "-std=c++17", "-O3", "-DNDEBUG", str(path), "-o", str(program), *flags]
    if for_this_machine:
        command.append("-march=native")
    subprocess.run(command, check=True)
    return program


def run(program: Path, *arguments: object) -> Any:
    """Return what a program prints, which is one JSON value.

    Raises:
        subprocess.CalledProcessError: If it fails.
    """
    command = [str(program), *map(str, arguments)]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(answer.stdout)
