"""`hypermap notes`: notes and media at places on a map."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.asked_note import AskedNote
from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.notes_shown import list_notes, show_note
from hypermap.cli.options import (
    AsJson,
    Force,
    MapPath,
    check_edited,
    check_new_map,
    name_of,
    only_one,
)
from hypermap.cli.saving import save_from
from hypermap.cli.terminal import note, say_json
from hypermap.console.options import AN_AREA
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hypermap.core.hypermap import Hypermap
    from hypermap.core.notes import Note
    from hypermap.core.notes_layer import NotesLayer
    from hypermap.notes import FoundNote

COMMAND_CLASS = PointsCommand

_FIND, _CHANGE = "Which notes", "Change"
_EDITOR = "hypermap notes"


def command(
    path: MapPath,
    write: Annotated[
        str | None,
        typer.Option(
            "--write",
            metavar="TEXT",
            help="Add a note with this text (Markdown) at --place; - reads it from standard input.",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    edit: Annotated[
        int | None,
        typer.Option(
            "--edit",
            metavar="ID",
            help="Change a note: --text replaces its text, --place moves it, --attach and --link "
            "add to it.",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    text: Annotated[
        str | None,
        typer.Option(
            "--text", metavar="TEXT", help="New text for --edit.", rich_help_panel=_CHANGE
        ),
    ] = None,
    remove: Annotated[
        list[int] | None,
        typer.Option(
            "--remove", metavar="ID", help="Remove a note (repeatable).", rich_help_panel=_CHANGE
        ),
    ] = None,
    attach: Annotated[
        list[Path] | None,
        typer.Option(
            "--attach",
            metavar="FILE",
            help="Attach a picture, sound, video or any other file (repeatable).",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            "--link", metavar="URL", help="Attach a link (repeatable).", rich_help_panel=_CHANGE
        ),
    ] = None,
    author: Annotated[
        str | None,
        typer.Option(
            "--author", metavar="NAME", help="Author: of the new note, or of the notes to find."
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(
            "--time",
            metavar="TIME",
            show_default="now",
            help="Time of the note.",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    place: Annotated[
        str | None,
        typer.Option(
            "--place",
            metavar="X,Y|AREA",
            help="Place of the note: a point, an area as for --in, or a room.",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    area: Annotated[
        str | None,
        typer.Option(
            "--in", metavar="AREA|ROOM", help=f"Only this area: {AN_AREA}; or rooms of this name."
        ),
    ] = None,
    word: Annotated[
        str | None,
        typer.Option(
            "--word",
            metavar="WORDS",
            help="Only notes with each of these words in the text, the author or a file's name.",
            rich_help_panel=_FIND,
        ),
    ] = None,
    around: Annotated[
        str | None,
        typer.Option(
            "--around", metavar="X,Y", help="Nearest to this place first.", rich_help_panel=_FIND
        ),
    ] = None,
    radius: Annotated[
        float | None,
        typer.Option(
            "--radius",
            metavar="METERS",
            help="Largest distance to --around.",
            rich_help_panel=_FIND,
        ),
    ] = None,
    after: Annotated[
        str | None,
        typer.Option(
            "--after", metavar="TIME", help="Only notes from this time on.", rich_help_panel=_FIND
        ),
    ] = None,
    before: Annotated[
        str | None,
        typer.Option(
            "--before", metavar="TIME", help="Only notes up to this time.", rich_help_panel=_FIND
        ),
    ] = None,
    show: Annotated[
        int | None,
        typer.Option(
            "--show", metavar="ID", help="Show one note with its whole text.", rich_help_panel=_FIND
        ),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option(
            "--save-files",
            metavar="DIR",
            help="Write the attached files of the found notes into this folder.",
            rich_help_panel=_FIND,
        ),
    ] = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(
            "--layer",
            metavar="NAME",
            show_default="the only one",
            help="Only this layer: a change needs one.",
        ),
    ] = None,
    frame: Annotated[
        str | None,
        typer.Option(
            "--frame",
            metavar="FRAME",
            show_default="the map's base frame",
            help="Frame of the coordinates: of --place, --in and --around.",
        ),
    ] = None,
    inside_up_to: Annotated[
        float | None,
        typer.Option(
            "--inside-up-to",
            metavar="MB",
            min=0,
            show_default="2, or what the layer says",
            help="Larger files are kept next to the map, not in it.",
            rich_help_panel=_CHANGE,
        ),
    ] = None,
    tidy: Annotated[
        bool,
        typer.Option(
            "--tidy",
            help="Delete files next to the map that neither it nor its backup uses.",
            rich_help_panel=_CHANGE,
        ),
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default="MAP",
            help="Save here: a changed map, .hmap.",
        ),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """List the notes of a map, find some, or add, change and remove notes.

    A note has a place, a text in Markdown, files, links, an author and a time. Without --write,
    --edit, --remove or --show, the notes are listed. Changes are saved in MAP, and its old version
    stays as MAP.bak. Small files are kept in the map, larger ones next to it in MAP.media.

    Examples:
        hypermap notes office.hmap --write "Loose tile" --place 2.1,0.8 --attach tile.jpg
        hypermap notes office.hmap --word tile --in kitchen
        hypermap notes office.hmap --show 1
        hypermap notes office.hmap --save-files attached
    """
    from hypermap.formats import open_map
    from hypermap.formats.locks import turn_to_edit
    from hypermap.notes import described

    changes = [option for option in (write, edit, remove) if option is not None]
    if len(changes) > 1:
        raise HypermapError("give only one of --write, --edit and --remove")
    name = only_one(layer)
    asked = AskedNote(name, frame, author, place, area, time, text, attach or [], link or [])
    asked.check(write is not None, edit is not None)
    if output is not None:
        check_new_map(output, force)
    new = sys.stdin.read() if write == "-" else write
    is_changed = bool(changes) or inside_up_to is not None
    if is_changed and output is None:
        check_edited(path)
    with turn_to_edit(*([output or path] if is_changed else [])):
        hypermap = open_map(path)
        if inside_up_to is not None:
            _layer(hypermap, asked, make=new is not None).inside_up_to = round(inside_up_to * 1e6)
        if new is not None:
            shown = [_add(hypermap, new, asked)]
        elif edit is not None:
            shown = [_edit(hypermap, edit, asked)]
        elif remove is not None:
            shown = _remove(hypermap, remove, name)
        else:
            shown = _found(hypermap, asked, word, around, radius, after, before, show)
        if is_changed:
            _save(hypermap, path, output)
    if as_json:
        say_json({"frame_id": hypermap.base_frame, "notes": [described(each) for each in shown]})
    elif show is not None or write is not None or edit is not None:
        show_note(shown[0])
    elif not (tidy or remove):
        list_notes(shown)
    if export is not None:
        _export(shown, export)
    if tidy:
        _tidy(output or path)


def _layer(hypermap: Hypermap, asked: AskedNote, *, make: bool) -> NotesLayer:
    from hypermap.notes.on_map import layer_to_add_to, notes_layer

    return (layer_to_add_to if make else notes_layer)(hypermap, asked.layer)


def _add(hypermap: Hypermap, text: str, asked: AskedNote) -> FoundNote:
    from hypermap.core.notes import now
    from hypermap.notes import Note, add_note
    from hypermap.questions.times import parse_moment

    place = asked.place(hypermap)
    assert place is not None
    when = now() if asked.time is None else parse_moment(asked.time, "--time")
    new = Note(place, text, asked.author or "", when, asked.attachments(), asked.links)
    return add_note(hypermap, new, asked.layer)


def _edit(hypermap: Hypermap, number: int, asked: AskedNote) -> FoundNote:
    from hypermap.notes import FoundNote
    from hypermap.questions.times import parse_moment

    layer = _layer(hypermap, asked, make=False)
    base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    place, files = asked.place(hypermap), asked.attachments()
    given: dict[str, Any] = {
        "text": asked.text,
        "author": asked.author,
        "time": None if asked.time is None else parse_moment(asked.time, "--time"),
        "place": None if place is None else base_T_layer.inverse().apply_geometry(place),
    }
    given = {key: value for key, value in given.items() if value is not None}

    def changed(old: Note) -> Note:
        return replace(
            old, **given, attachments=old.attachments + files, links=old.links + asked.links
        )

    new = layer.update(number, changed)
    return FoundNote(layer.name, new.moved(base_T_layer))


def _remove(hypermap: Hypermap, numbers: Sequence[int], layer: str | None) -> list[FoundNote]:
    from hypermap.notes import FoundNote, notes_layer

    chosen = notes_layer(hypermap, layer)
    base_T_layer = hypermap.frames.lookup(hypermap.base_frame, chosen.frame_id)
    gone = [chosen.remove(number) for number in dict.fromkeys(numbers)]
    return [FoundNote(chosen.name, each.moved(base_T_layer)) for each in gone]


def _found(
    hypermap: Hypermap,
    asked: AskedNote,
    word: str | None,
    around: str | None,
    radius: float | None,
    after: str | None,
    before: str | None,
    show: int | None,
) -> list[FoundNote]:
    from hypermap.console.places import parse_point
    from hypermap.core.errors import ObjectNotFound
    from hypermap.notes import find_notes
    from hypermap.questions.times import parse_moment

    if radius is not None and around is None:
        raise HypermapError("--radius needs --around: a distance from what?")
    point = None
    if around is not None:
        point = asked.in_base(hypermap).apply(parse_point(around, "--around"))[0]
    found = find_notes(
        hypermap,
        word or "",
        area=asked.area_in_base(hypermap),
        near=point,
        within=radius,
        since=None if after is None else parse_moment(after, "--after"),
        until=None if before is None else parse_moment(before, "--before"),
        author=asked.author or "",
        layer=asked.layer,
    )
    if show is None:
        return found
    chosen = [each for each in found if each.note.id == show]
    if not chosen:
        raise ObjectNotFound(f"there is no note {show}; list them with: hypermap notes MAP")
    return chosen


def _save(hypermap: Hypermap, path: Path, output: Path | None) -> None:
    from hypermap.formats.backup import save_edited

    if output is None and path.suffix.lower() != ".hmap":
        raise HypermapError(f"{name_of(path)}: notes are kept in .hmap files; give -o OUT.hmap")
    if output is None:
        save_edited(hypermap, path, _EDITOR)
    else:
        save_from(hypermap, path, output)
    note(f"saved {output or path}")


def _export(shown: Iterable[FoundNote], folder: Path) -> None:
    from hypermap.formats.beside import export_files

    written = export_files([each.note for each in shown], folder)
    note(f"wrote {counted(len(written), 'file')} to {folder}")


def _tidy(path: Path) -> None:
    """Delete the files next to a map that neither it nor its backup refers to."""
    from hypermap.core.notes_layer import NotesLayer
    from hypermap.formats import open_map
    from hypermap.formats.backup import backup_of
    from hypermap.formats.beside import folder_beside, unused_beside

    maps = [open_map(file) for file in (path, backup_of(path)) if file.exists()]
    layers = (layer for each in maps for layer in each if isinstance(layer, NotesLayer))
    used = [file for layer in layers for one in layer for file in one.attachments]
    unused = unused_beside(path.with_name(folder_beside(path)), used)
    for file in unused:
        file.unlink()
    note(f"deleted {counted(len(unused), 'file')} that no note uses")
