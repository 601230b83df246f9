"""Names of places on a map: its rooms and objects."""

from __future__ import annotations

import re
from typing import TypeAlias

from hypermap.core.arrays import PointsLike
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.rooms.questions import room_called
from hypermap.rooms.rooms import Room, rooms_on

Place: TypeAlias = str | int | PointsLike
"""A point [m], a room's name, an object's id, its name, or both as "cup 3"."""

_MOST = 10  # names in a message


def title(item: FoundObject) -> str:
    """Return the name of an object, such as "cup 3"."""
    return f"{item.object.name} {item.object.id}"


class Places:
    """The rooms and objects of a map, in its base frame.

    Attributes:
        rooms: those of its layer `rooms`; None where it has none.
    """

    def __init__(self, hypermap: Hypermap) -> None:
        self._hypermap = hypermap
        self.rooms = rooms_on(hypermap)

    def objects(self, layer: str | None = None) -> list[FoundObject]:
        """Return the objects of a layer; None for those of all but that of the rooms."""
        found = self._hypermap.objects(layer=layer)
        return [item for item in found if layer is not None or item.layer != ROOMS]

    def room(self, what: Place) -> Room | None:
        """Return the room of a name or id; None if it is not a room's name.

        Raises:
            HypermapError: If several have that name.
        """
        if self.rooms is None or not isinstance(what, str):
            return None
        return room_called(self.rooms, what)

    def object(self, what: str | int) -> FoundObject:
        """Return the one object of a name or id.

        Raises:
            HypermapError: If there is none, or several are.
        """
        known = self.objects()
        found = [item for item in known if what in (item.object.name, item.object.id)]
        if not found and isinstance(what, str):
            found = [item for item in known if re.sub(r"\s+", " ", what.strip()) == title(item)]
        if len(found) == 1:
            return found[0]
        if found:
            titles = [f"{title(item)!r}" for item in found[:_MOST]]
            known_as = ", ".join(titles + ["..."] * (len(found) > _MOST))
            raise HypermapError(
                f"{len(found)} objects are called {what!r}; ask for one of {known_as}"
            )
        names = sorted({str(item.object.name) for item in known})
        names += [] if self.rooms is None else [room.name for room in self.rooms]
        hint = did_you_mean(re.sub(r"\s+\d+$", "", str(what)), names)
        raise HypermapError(f"there is no object or room {what!r}; {hint}")
