"""The layer of notes: what people or robots left at places."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import datetime
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike, as_objects, as_point_xy, as_points_xy
from hypermap.core.errors import ObjectNotFound
from hypermap.core.layer import Hits, Layer
from hypermap.core.notes import Note, now
from hypermap.core.shapes import as_area

EMPTY = "Empty"  # the label where there is no note
NO_NOTE = -1  # the value there

REACH = 0.5
"""Distance to a point at which a note at that point is an answer [m]."""

INSIDE_UP_TO = 2_000_000
"""Size of the largest file that is kept inside a map, not next to it, in bytes."""


class NotesLayer(Layer):
    """Notes with places. The label of a place is the title of the note there, the value its id.

    A note at a point answers up to half a meter around it. Where there are several notes, those
    at points come before areas and small areas before large ones. An id is not reused while
    the layer exists. Each change makes a new table of notes, so each query sees the layer
    either before or after a change.

    Attributes:
        inside_up_to: size of the largest attached file that is kept inside a saved map [bytes];
            larger ones are next to it.

    Raises:
        ValueError: If two notes have the same id.

    >>> layer = NotesLayer("notes", "map")
    >>> layer.add(Note(shapely.Point(2, 1), "# Loose tile", author="Ada"))
    1
    >>> layer.label_at([[2.1, 1.0], [5.0, 5.0]])
    array(['Loose tile', 'Empty'], dtype=object)
    >>> [note.id for note in layer.search("tile")]
    [1]
    """

    class_name: ClassVar[str] = "NotesLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        notes: Iterable[Note] = (),
        settings: Mapping[str, Any] | None = None,
        *,
        next_id: int = 1,
        inside_up_to: int = INSIDE_UP_TO,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.inside_up_to = inside_up_to
        self._writing = threading.Lock()
        self._next_id = max(next_id, 1)
        self._notes: dict[int, Note] = {}
        for note in notes:
            self.add(note)

    def copy(self) -> NotesLayer:
        """Return an equal layer; changes to one do not affect the other."""
        other = NotesLayer(self.name, self.frame_id, (), self.settings, next_id=self._next_id)
        other.inside_up_to, other._notes = self.inside_up_to, self._notes
        return other

    __copy__ = copy

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_writing": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _writing=threading.Lock())

    def summary(self) -> str:
        """Return how many notes there are, and what is attached to them."""
        files = sum(len(note.attachments) for note in self)
        notes = f"{len(self)} note{'' if len(self) == 1 else 's'}"
        return f"{notes} with {files} file{'' if files == 1 else 's'}" if files else notes

    # The notes

    def __len__(self) -> int:
        return len(self._notes)

    def __iter__(self) -> Iterator[Note]:
        """Yield the notes that exist when iteration begins, in the order of their ids."""
        return iter(self.notes())

    def __contains__(self, item: object) -> bool:
        return (item.id if isinstance(item, Note) else item) in self._notes

    def __getitem__(self, note_id: int) -> Note:
        """Return the note with that id.

        Raises:
            ObjectNotFound: If there is none.
        """
        return self._note(self._notes, note_id)

    @property
    def next_id(self) -> int:
        """The least id that no note of this layer has had so far."""
        return self._next_id

    def notes(self) -> list[Note]:
        """Return all notes in the order of their ids."""
        return [note for _, note in sorted(self._notes.items())]

    def search(
        self,
        words: str = "",
        *,
        area: BaseGeometry | None = None,
        since: datetime | None = None,
        until: datetime | None = None,
        author: str = "",
    ) -> list[Note]:
        """Return the notes that meet all conditions, in the order of their ids.

        Args:
            words: each is in the text, the author or the names of what is attached, in any case.
            area: which the place meets, in the frame of the layer [m].
            since: the time of the note is not before.
            until: the time of the note is not after.
            author: in any case.
        """
        within = None if area is None else as_area(area)
        return [
            note
            for note in self.notes()
            if note.says(words)
            and (since is None or note.time >= since)
            and (until is None or note.time <= until)
            and (not author or note.author.casefold() == author.casefold())
            and (within is None or within.intersects(note.place))
        ]

    # Changes

    def add(self, note: Note) -> int:
        """Add a note, and return its id; a note without one gets the next free one.

        Raises:
            ValueError: If its id is in use.
        """
        with self._writing:
            number = self._next_id if note.id is None else note.id
            if number in self._notes or number < 0:
                raise ValueError(f"there is a note {number} already, or it is not an id")
            self._notes = {**self._notes, number: replace(note, id=number)}
            self._next_id = max(self._next_id, number + 1)
        return number

    def update(self, note_id: int, change: Callable[[Note], Note]) -> Note:
        """Change a note, and return the new one, with the time of the change.

        Args:
            note_id: which; it is kept.
            change: makes the new note of the old one.

        Raises:
            ObjectNotFound: If there is none.
        """
        with self._writing:
            old = self._note(self._notes, note_id)
            new = replace(change(old), id=old.id, changed=now())
            self._notes = {**self._notes, note_id: new}
        return new

    def remove(self, note_id: int) -> Note:
        """Remove a note, and return it.

        Raises:
            ObjectNotFound: If there is none.
        """
        with self._writing:
            gone = self._note(self._notes, note_id)
            self._notes = {number: note for number, note in self._notes.items() if note is not gone}
        return gone

    def _note(self, notes: Mapping[int, Note], note_id: int) -> Note:
        if note_id not in notes:
            raise ObjectNotFound(f"layer {self.name!r} has no note {note_id!r}")
        return notes[note_id]

    # Queries that every layer answers

    def notes_at(self, point_xy: PointsLike) -> list[Note]:
        """Return the notes at one point: points within half a meter, then areas around it."""
        return self._at(as_point_xy(point_xy).reshape(1, 2))[0]

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the title of the first note at each point, shape (N,), or "Empty"."""
        found = self._at(as_points_xy(points_xy))
        return as_objects(each[0].title if each else EMPTY for each in found)

    def labels_at(self, point_xy: PointsLike) -> ObjectArray:
        """Return the titles of all notes at one point, shape (M,)."""
        return as_objects([note.title for note in self.notes_at(point_xy)] or [EMPTY])

    def value_at(self, points_xy: PointsLike) -> NDArray[np.int64]:
        """Return the id of the first note at each point, shape (N,), or -1."""
        found = self._at(as_points_xy(points_xy))
        return np.array([each[0].id if each else NO_NOTE for each in found], dtype=np.int64)

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the title and place of each note that an area meets."""
        notes = self.search(area=area)
        return Hits(as_objects(note.title for note in notes), _places(notes))

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the id and place of each note that an area meets."""
        notes = self.search(area=area)
        return Hits(np.array([note.id for note in notes], dtype=np.int64), _places(notes))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return where notes have a title or an id, shape (M, 2); `search` looks for words."""
        notes = self.search(area=area)
        is_title = isinstance(what, str)
        return _places([note for note in notes if (note.title if is_title else note.id) == what])

    def extent(self) -> BaseGeometry:
        """Return a box around all places, half a meter larger than they are."""
        if not len(self):
            return shapely.Polygon()
        x0, y0, x1, y1 = shapely.total_bounds([note.place for note in self])
        around: BaseGeometry = shapely.box(x0 - REACH, y0 - REACH, x1 + REACH, y1 + REACH)
        return around

    def _at(self, points_xy: NDArray[np.float64]) -> list[list[Note]]:
        """Return the notes at each point, shape (N, 2), the first ones first."""
        notes = self.notes()
        found: list[list[tuple[float, float, int]]] = [[] for _ in points_xy]
        tree = shapely.STRtree([note.place for note in notes])
        points = as_objects(map(shapely.Point, points_xy))
        for row, number in tree.query(points, "dwithin", REACH).T.tolist():
            place = notes[number].place
            distance = place.distance(points[row])
            if isinstance(place, shapely.Point) or distance == 0:
                found[row].append((place.area, distance, number))
        return [[notes[number] for *_, number in sorted(each)] for each in found]


def _places(notes: Iterable[Note]) -> NDArray[np.float64]:
    """Return the points, or the centroids of the areas, shape (N, 2)."""
    points = [note.place.centroid for note in notes]
    return np.array([(point.x, point.y) for point in points], dtype=np.float64).reshape(-1, 2)
