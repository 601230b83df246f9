"""`hypermap expire`: say until when an object or a zone is in force."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import MapPath, check_edited, name_of, only_one
from hypermap.cli.terminal import note, say
from hypermap.core.errors import HypermapError, ObjectNotFound
from hypermap.fleet.store.address import parse_address
from hypermap.text import is_address, printable

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.objects import SemanticObject


def command(
    path: MapPath,
    object_id: Annotated[
        int, typer.Argument(metavar="ID", show_default=False, help="Id of the object.")
    ],
    until: Annotated[
        str,
        typer.Option(
            metavar="TIME|never",
            show_default=False,
            help="2026-11-25T18:00, 18:00 (today), 'in 2 hours', 2h, 7d; never removes the limit.",
        ),
    ],
    layer: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", show_default="the only one", help="Only this layer: that of the object."
        ),
    ] = None,
) -> None:
    """Set the time at which an object of MAP expires, such as a zone that is closed for cleaning.

    After that time, queries ignore the object and nodes do not publish it. It is then only in the
    history of the map.

    Examples:
        hypermap expire office.hmap 3 --layer zones --until 2026-11-25T18:00
        hypermap expire office.hmap 3 --layer zones --until 2h
        hypermap expire office.hmap 3 --layer zones --until never
    """
    from hypermap.formats import open_map, save_map
    from hypermap.formats.config import file_of_map
    from hypermap.formats.locks import turn_to_edit

    name = only_one(layer)
    moment = _later(until)
    if is_address(path):
        if parse_address(path).version is not None:
            raise HypermapError(f"{name_of(path)}: an earlier version of a site cannot be changed")
        item = _limit(path, open_map(path), name, object_id, moment)  # the store writes it
    else:
        file = file_of_map(path)
        check_edited(file)
        with turn_to_edit(file):
            hypermap = open_map(path)
            item = _limit(path, hypermap, name, object_id, moment)
            save_map(hypermap, path)
    said = "never expires" if moment is None else f"expires on {moment:%Y-%m-%d at %H:%M %Z}"
    say(f"{printable(item.name)} {object_id} {said}".rstrip())
    if moment is not None and moment <= datetime.now(moment.tzinfo):
        note("warning: that is in the past, so it answers no query any more; undo by --until never")


def _limit(
    path: Path, hypermap: Hypermap, layer: str | None, object_id: int, moment: datetime | None
) -> SemanticObject:
    """Set when an object of a map expires, and return the object."""
    from hypermap.history import EXPIRES

    objects = hypermap.semantic(layer)
    try:
        item = objects.get(object_id)
    except ObjectNotFound as error:
        raise HypermapError(f"{name_of(path)}: {error}") from None
    attributes = {key: value for key, value in item.attributes.items() if key != EXPIRES}
    if moment is not None:
        attributes[EXPIRES] = moment.isoformat(timespec="seconds")
    objects.update(object_id, replace(item, attributes=attributes))
    return item


def _later(text: str) -> datetime | None:
    """Return the time that a text names, spans counted from now; None for never."""
    from hypermap.questions.times import parse_later

    return None if text.strip().lower() == "never" else parse_later(text, "--until")
