"""Arguments and options that several commands share."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from hypermap.cli.terminal import INTERRUPTED
from hypermap.core.errors import HypermapError
from hypermap.text import is_address, visible

MapPath = Annotated[
    Path,
    typer.Argument(
        metavar="MAP",
        readable=False,
        show_default=False,
        help="An .hmap archive, a configuration file in a folder, a map_server YAML, or the "
        "address of a site in a shared store.",
    ),
]
MapOutput = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="OUT", show_default=False, help="Save here: .hmap."),
]
OptionalMapOutput = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="OUT", show_default=False, help="Save here: .hmap."),
]
OnlyLayers = Annotated[
    list[str] | None,
    typer.Option("--layer", metavar="NAME", help="Only this layer: may be repeated."),
]
OnlyNames = Annotated[
    list[str] | None,
    typer.Option("--name", metavar="NAME", help="Only objects with this name: may be repeated."),
]
TaxonomyFile = Annotated[
    Path | None,
    typer.Option(
        "--taxonomy",
        metavar="FILE",
        show_default=False,
        help="YAML file with more names and kinds of objects; see docs/ask.md.",
    ),
]


def port_option(default: str, condition: str = "", panel: str | None = None) -> Any:
    """Return the option `--port` of a command that serves.

    Args:
        default: what the help says of the default.
        condition: when the command serves, such as "with --foxglove"; empty for always.
        panel: of the help in which the option is; None for the first one.
    """
    only = f"{condition}; " if condition else ""
    return typer.Option(
        min=0,
        max=65535,
        show_default=default,
        rich_help_panel=panel,
        help=f"Port to listen on: {only}0 for any free port.",
    )


PAGE_PORT = "8090, or the next one that is free"
"""The default of `--port` for the page in the browser."""

Port = Annotated[int | None, port_option(PAGE_PORT)]
_YAML_HEAD = 65536  # bytes of a YAML file next to a picture that are looked at

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
Force = Annotated[bool, typer.Option("--force", "-f", help="Replace an existing OUT.")]

ForceMap = Annotated[
    bool,
    typer.Option("--force", "-f", help="Replace an existing OUT: even if it was edited by hand."),
]


def check_output(path: Path, replace: bool) -> None:
    """Make sure before a long work that its result can be saved.

    Whether a write-protected file may be replaced is asked at a terminal, whatever `replace` says.

    Raises:
        HypermapError: If the folder is missing or closed, or the file exists and must not be
            replaced.
        typer.Exit: If Ctrl-C is the answer.
    """
    from hypermap.formats.atomic import is_write_protected

    folder = path.absolute().parent
    if path.is_dir():
        raise HypermapError(f"{path}: this is a folder, not a file to save to")
    if not folder.is_dir():
        raise HypermapError(f"{path}: the folder {folder} does not exist; create it first")
    if not os.access(folder, os.W_OK):
        raise HypermapError(f"{path}: no permission to write in the folder {folder}")
    if path.exists() and not replace:
        raise HypermapError(f"{path} exists already; give --force to replace it")
    if is_write_protected(path):
        _ask(
            f"{path} is write-protected. Replace it?",
            f"{path} exists already, and is write-protected; make it writable, or give another "
            "name",
            path,
        )


def check_new_map(path: Path, replace: bool) -> None:
    """Make sure before a long work that a map can be saved, like `check_output`.

    Raises:
        HypermapError: If the suffix is another than .hmap, or as for `check_output`.
        typer.Exit: If Ctrl-C is the answer.
    """
    if path.suffix.lower() != ".hmap":
        raise HypermapError(f"{path}: a map is saved as .hmap")
    check_output(path, replace)


def check_edited(path: Path) -> None:
    """Make sure that a map may be changed in place, as `check_output` does for other files.

    Raises:
        HypermapError: If it is write-protected.
        typer.Exit: If Ctrl-C is the answer.
    """
    from hypermap.formats.atomic import is_write_protected

    if is_write_protected(path):
        refused = f"{path} is write-protected, so it is not changed; make it writable"
        _ask(f"{path} is write-protected. Change it?", refused, path)


def name_of(path: Path) -> str:
    """Return what a map is called in answers and messages: of a site, its address, no password."""
    from hypermap.fleet.store.address import parse_address

    return parse_address(path).shown if is_address(path) else str(path)


def title_of(path: Path) -> str:
    """Return what a map is called in the title of a picture: a site or a file by its name."""
    from hypermap.fleet.store.address import parse_address

    if not is_address(path):
        return path.stem
    address = parse_address(path)
    return address.site or address.shown


def only_one(layers: list[str] | None) -> str | None:
    """Return the layer that `--layer` names; None without it.

    Raises:
        HypermapError: If it names several.
    """
    if layers is not None and len(layers) > 1:
        raise HypermapError("give --layer once")
    return layers[0] if layers else None


def check_map_output(path: Path, force: bool) -> None:
    """Make sure before mapping that the map can be saved, and that this destroys no one's work.

    A map that mapping could make again may be replaced; whether any other may is asked at a
    terminal.

    Raises:
        HypermapError: If it cannot, or must not.
        typer.Exit: If Ctrl-C is the answer.
    """
    from hypermap.formats.backup import backup_of, why_precious

    check_new_map(path, replace=True)
    reason = None if force else why_precious(path)
    if reason is None:
        return
    backup = backup_of(path).name
    _ask(
        f"{path} exists already, and {reason}. Replace it? It stays as {backup}.",
        f"{path} exists already, and {reason}; give --force to replace it (it stays as {backup}), "
        "or another name",
        path,
    )


def _ask(question: str, refusal: str, path: Path) -> None:
    """Ask whether a file may be replaced; where there is no terminal, refuse."""
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise HypermapError(refusal)
    try:
        is_wanted = typer.confirm(visible(question), err=True)
    except typer.Abort:  # Ctrl-C or the end of input
        raise typer.Exit(INTERRUPTED) from None
    if not is_wanted:
        raise HypermapError(f"{path} is unchanged")


def check_picture(path: Path) -> None:
    """Make sure that a picture can be saved, and does not replace the cells of a grid.

    Raises:
        HypermapError: If it cannot, or a map_server YAML next to it names it as its image.
    """
    check_output(path, replace=True)
    if not path.exists():
        return
    names_it = re.compile(rf"^image:\s*(['\"]?)(\./)?{re.escape(path.name)}\1\s*$", re.MULTILINE)
    for yaml_file in path.absolute().parent.glob("*.yaml"):
        text = yaml_file.read_bytes()[:_YAML_HEAD].decode(errors="replace")
        if names_it.search(text):
            raise HypermapError(
                f"{path}: this is the picture of the grid {yaml_file.name}; it is not replaced"
            )
