"""`--onto`: continue a map of earlier drives."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import name_of
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.mapping.config import MappingConfig

SamePlace = Annotated[
    bool,
    typer.Option(
        "--same-place",
        help="RECORDING shows the place of --onto, in the same frame, by whatever name: do not "
        "check that.",
    ),
]


def is_same_file(one: Path, other: Path | None) -> bool:
    """Return whether two paths lead to the same existing file."""
    return other is not None and one.exists() and other.exists() and one.samefile(other)


def way_to_join(recording: Path, onto: Path, output: Path) -> str:
    """Return how to map a recording whose poses are in another frame than those of the map."""
    alone = f"{recording.stem}-alone.hmap"
    merge = ["hypermap", "merge", str(onto), alone, "-o", str(output)]
    return (
        f"leave out --onto, map it with -o {shlex.quote(alone)}, and join the two: "
        f"{shlex.join(merge)}"
    )


def map_to_go_on_with(path: Path | None, map_file: Path | None) -> Hypermap | None:
    """Return the map of `--onto`; None if it is not given.

    Raises:
        HypermapError: If it cannot be read, or `--map` is also given.
    """
    from hypermap.formats import open_map

    if path is None:
        return None
    if map_file is not None:
        raise HypermapError(
            f"--map: mapping continues with the occupancy layer of {path}; leave out --map, or "
            "make a new map"
        )
    return open_map(path)


def settings_of(
    base: Hypermap | None,
    onto: Path | None,
    profile: str | None,
    config: Path | None,
    score: float | None,
    has_network: bool,
) -> MappingConfig:
    """Return the configuration that the user asks for, or else that of the map.

    Raises:
        HypermapError: If it cannot be read, or mapping cannot go on with the map.
    """
    from hypermap.mapping.config import chosen_config
    from hypermap.mapping.going_on import config_to_go_on_with

    is_asked = any(given is not None for given in (profile, config, score))
    asked = chosen_config(profile, config, score, has_network)
    if base is None:
        return asked
    with named(onto):
        return config_to_go_on_with(base, asked if is_asked else None)


@contextmanager
def named(onto: Path | None) -> Iterator[None]:
    """Name the file in errors about maps that mapping cannot continue."""
    from hypermap.mapping.going_on import CannotGoOn

    try:
        yield
    except CannotGoOn as error:
        name = "the map" if onto is None else name_of(onto)
        raise HypermapError(f"{name}: {error}") from error
