"""What the options of `hypermap notes` say of a note: what it holds, and where it is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from shapely.geometry.base import BaseGeometry

    from hypermap.core.frames import Pose2D
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.notes import Attachment

_LARGE = 100_000_000  # bytes, of files that take a while


class AskedNote:
    """The options that say what a note holds and where it is."""

    def __init__(
        self,
        layer: str | None,
        frame: str | None,
        author: str | None,
        place: str | None,
        area: str | None,
        time: str | None,
        text: str | None,
        files: Sequence[Path],
        links: Sequence[str],
    ) -> None:
        self.layer, self.frame, self.author = layer, frame, author
        self.where, self.area, self.time, self.text = place, area, time, text
        self.files, self.links = files, tuple(links)

    def check(self, is_new: bool, is_edited: bool) -> None:
        """Raise a HypermapError for options that mean nothing together."""
        if is_new and self.where is None:
            raise HypermapError("where is the note? give --place X,Y")
        if is_new and self.text is not None:
            raise HypermapError("--text belongs to --edit; --write TEXT is the text of a new note")
        if (is_new or is_edited) and self.area is not None:
            raise HypermapError("--in finds notes; the place of a note is --place")
        if not is_new and not is_edited:
            given = {
                "--text": self.text,
                "--time": self.time,
                "--attach": self.files or None,
                "--link": self.links or None,
                "--place": self.where,
            }
            for option, value in given.items():
                if value is not None:
                    hint = "; --around finds notes there" if option == "--place" else ""
                    raise HypermapError(f"{option} belongs to --write or --edit{hint}")

    def place(self, hypermap: Hypermap) -> BaseGeometry | None:
        """Return the place of a note in the base frame; None if none was given."""
        import shapely

        from hypermap.console.places import parse_point

        if self.where is None or len(self.where.split(",")) != 2 or " " in self.where.strip():
            return self._area(hypermap, self.where, "--place")
        return shapely.Point(self.in_base(hypermap).apply(parse_point(self.where, "--place"))[0])

    def area_in_base(self, hypermap: Hypermap) -> BaseGeometry | None:
        """Return the area in which notes are looked for, in the base frame; None for any."""
        return self._area(hypermap, self.area, "--in")

    def in_base(self, hypermap: Hypermap) -> Pose2D:
        """Return the pose of the frame of coordinates in the base frame."""
        return hypermap.frames.lookup(hypermap.base_frame, self.frame or hypermap.base_frame)

    def _area(self, hypermap: Hypermap, text: str | None, option: str) -> BaseGeometry | None:
        import shapely

        from hypermap.console.places import names_rooms, parse_area
        from hypermap.rooms.questions import rooms_asked

        if text is None:
            return None
        if names_rooms(text):
            rooms: BaseGeometry = shapely.union_all(
                [room.outline for room in rooms_asked(hypermap, text)]
            )
            return rooms
        return self.in_base(hypermap).apply_geometry(parse_area(text, option))

    def attachments(self) -> tuple[Attachment, ...]:
        """Return the files, looked into."""
        from hypermap.notes import attachment_of

        for file in self.files:
            if file.is_file() and (size := file.stat().st_size) > _LARGE:
                note(f"copying {file}, {size / 1e6:.0f} MB")
        return tuple(map(attachment_of, self.files))
