"""Notes on the terminal: many as a table, one with all that it holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypermap.cli.terminal import facts, out, say, table
from hypermap.text import counted, printable, visible

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypermap.core.notes import Note
    from hypermap.notes import FoundNote


def list_notes(shown: Sequence[FoundNote]) -> None:
    """Print notes, one in a line."""
    from hypermap.notes.on_map import point_of
    from hypermap.questions.times import minute_of

    if not shown:
        say("no notes found")
        return
    rows = table("id", "note", "time", "author", "x", "y", "attached", right=("id", "x", "y"))
    for found in shown:
        one = found.note
        x, y = point_of(one)
        place = (f"{x:.2f}", f"{y:.2f}")
        about = (minute_of(one.time), printable(one.author), *place, _attached(one))
        rows.add_row(str(one.id), printable(one.title, 60), *about)
    out().print(rows)


def _attached(one: Note) -> str:
    kinds = [each.kind for each in one.attachments] + ["link"] * len(one.links)
    return ", ".join(counted(kinds.count(kind), kind) for kind in dict.fromkeys(kinds))


def show_note(found: FoundNote) -> None:
    """Print a note with all that it holds."""
    from hypermap.notes.on_map import point_of
    from hypermap.questions.times import minute_of

    one = found.note
    x, y = point_of(one)
    area = "" if one.place.area == 0 else f", {one.place.area:.1f} m2 around it"
    rows = [
        ("note", f"{one.id} in layer {printable(found.layer)}"),
        ("at", f"{x:.2f}, {y:.2f}{area}"),
        ("time", minute_of(one.time)),
    ]
    if one.changed is not None:
        rows.append(("changed", minute_of(one.changed)))
    if one.author:
        rows.append(("author", printable(one.author, 100)))
    for each in one.attachments:
        missing = "" if each.is_there else ", missing"
        kind = each.kind if each.kind != "file" else each.media_type
        rows.append(("file", f"{printable(each.name, 60)} ({kind}, {_size(each.size)}{missing})"))
    rows += [("link", printable(link, 200)) for link in one.links]
    out().print(facts(rows))
    if one.text.strip():
        say()
        for line in one.text.splitlines():
            say(visible(line))


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 100_000 else f"{count / 1e3:.1f} kB"
