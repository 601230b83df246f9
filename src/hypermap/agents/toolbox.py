"""All tools for a map."""

from __future__ import annotations

from pathlib import Path

from hypermap.agents.editing import Editing
from hypermap.agents.looking import Looking
from hypermap.agents.open_map import OpenMap
from hypermap.agents.tools import Tool, ToolFunction


def tools_for(
    path: str | Path,
    *,
    allow_edits: bool = False,
    robot_radius: float = 0.0,
    taxonomy: Path | None = None,
) -> list[Tool]:
    """Return the tools for a map file; they follow the file when it changes.

    Args:
        path: a map.
        allow_edits: whether to include those that change the map and save it.
        robot_radius: of the robot that paths are for [m].
        taxonomy: a file of more names of objects.

    Raises:
        HypermapError: If the file is not a map.
    """
    opened = OpenMap(Path(path), allow_edits)
    return tools_of(opened, Looking(opened.current, robot_radius, taxonomy), allow_edits)


def tools_of(opened: OpenMap, looking: Looking, allow_edits: bool) -> list[Tool]:
    """Return the tools for an open map."""
    editing = Editing(opened)
    edits: list[ToolFunction] = [
        editing.add_zone,
        editing.rename,
        editing.mark_gone,
        editing.add_note,
    ]
    changing = [Tool(edit, is_edit=True) for edit in edits]
    return tools_to_look(looking) + (changing if allow_edits else [])


def tools_to_look(looking: Looking) -> list[Tool]:
    """Return the tools that look at a map, wherever it comes from."""
    looks: list[ToolFunction] = [
        looking.find_objects,
        looking.nearest,
        looking.find_like,
        looking.what_is_at,
        looking.list_rooms,
        looking.describe_room,
        looking.path_to,
        looking.changes,
        looking.ask,
        looking.render_view,
        looking.show_object,
        looking.find_notes,
    ]
    return [Tool(look) for look in looks]
