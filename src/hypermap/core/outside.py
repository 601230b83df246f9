"""Functions from packages above the core: save, plot, show in a notebook, write a file.

The core must not import these packages. So the package `hypermap` registers a lookup (`offer`), and
the functions here call theirs by name.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hypermap.core.arrays import BoolArray, PointsLike
    from hypermap.core.embeddings import TextEncoder
    from hypermap.core.found import Found
    from hypermap.core.hypermap import Hypermap

_offered: Callable[[str], Callable[..., Any]] | None = None


def offer(function_named: Callable[[str], Callable[..., Any]]) -> None:
    """Register a lookup that returns a function outside the core by its name, e.g. "save_map"."""
    global _offered
    _offered = function_named


def _outside(name: str) -> Callable[..., Any]:
    assert _offered is not None  # `hypermap` calls `offer` when it is imported
    return _offered(name)


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file so that at any moment either the old or the new content is there.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If it cannot be written; the old file is untouched then.
    """
    _outside("write_file")(path, content)


def refuse_pointer(path: Path) -> None:
    """Refuse the pointer that Git LFS leaves in place of a file that it has not fetched.

    Raises:
        FormatError: Saying how to fetch the file.
    """
    _outside("refuse_pointer")(path)


def open_site(address: str | Path) -> Hypermap:
    """Return the map of a site in a shared store, by its address.

    Raises:
        HypermapError: If the store cannot be reached, or there is no such site.
    """
    opened: Hypermap = _outside("open_site")(address)
    return opened


def text_encoder() -> TextEncoder:
    """Return the encoder of texts that the environment variable HYPERMAP_EMBEDDER names.

    Raises:
        HypermapError: If it names none, or a wrong one.
    """
    encoder: TextEncoder = _outside("embedder_in_use")()
    return encoder


class OutsideMethods:
    """The methods of a map that are implemented outside the core."""

    def save(self, path: str | Path) -> None:
        """Save the map so that `open_map` returns an equal one; the same as `hypermap.save_map`.

        Args:
            path: of the file, such as "office.hmap".

        Raises:
            HypermapError: If it cannot be written; the old file then remains.
        """
        _outside("save_map")(self, path)

    def plot(self, axes: Any = None, **options: Any) -> Any:
        """Draw the map into matplotlib axes and return them; the same as `hypermap.plot`.

        Args:
            axes: where to draw; None for a new figure.
            options: such as `layers`, `names`, `area`, `labels`, `legend`.
        """
        return _outside("plot")(self, axes, **options)

    def nearest_by_path(
        self, what: str | float, point_xy: PointsLike, k: int = 1, layer: str | None = None
    ) -> list[Found]:
        """Return the k objects with the shortest paths to them, like `nearest` with `by="path"`.

        Args:
            what: a name or an id.
            point_xy: from where, in the base frame [m].
            k: how many at most.
            layer: only objects of this layer; None for all.
        """
        found: list[Found] = _outside("nearest_by_path")(self, what, point_xy, k, layer)
        return found

    def stand_in_rooms(self, what: str, points_xy: PointsLike) -> BoolArray | None:
        """Return which points are in rooms with a name or of a kind; None if there are none.

        Args:
            what: a name or a kind.
            points_xy: in the base frame [m], shape (N, 2).
        """
        standing: BoolArray | None = _outside("stand_in_rooms")(self, what, points_xy)
        return standing

    def ask(
        self,
        question: Any,
        pose: Any = None,
        *,
        taxonomy: str | Path | None = None,
        robot_radius: float = 0.0,
        encoder: TextEncoder | None = None,
    ) -> Any:
        """Return the answer to a question; the same as `hypermap.questions.ask_map`.

        Args:
            question: a `Query`, JSON values of one, or a text in English.
            pose: where the asker is in the base frame: a `Pose2D`, or (x, y) [m]; None if unknown.
            taxonomy: a file of more names of objects.
            robot_radius: of the robot that distances by path are for [m].
            encoder: of texts that objects are to look like; None for the one that the environment
                variable HYPERMAP_EMBEDDER names.

        Returns:
            An `Answer`, with `objects`, `rooms`, `count` and `notes`.

        Raises:
            HypermapError: If the question cannot be read or answered.
        """
        asked = {"taxonomy": taxonomy, "robot_radius": robot_radius, "encoder": encoder}
        return _outside("ask_map")(self, question, pose, **asked)

    def as_of(self, moment: datetime | date | str | float) -> Hypermap:
        """Return the map as it was at a time; the same as `hypermap.history.as_of`.

        Args:
            moment: a datetime or its ISO 8601 form, without a zone that of this computer; a date,
                for its beginning; or seconds since 1970.

        Raises:
            HypermapError: If the map keeps no history, it does not reach back so far, or is lost.
            ValueError: If the text or number is not a time.
            TypeError: If it is something else.
        """
        past: Hypermap = _outside("as_of")(self, moment)
        return past

    def find_like(self, text: str, k: int = 5, encoder: TextEncoder | None = None) -> list[Found]:
        """Return the k objects that look most like a text, the most similar first.

        Args:
            text: such as "something to sit on".
            k: how many at most.
            encoder: as `hypermap.load_embedder` returns it; None for the one that the environment
                variable HYPERMAP_EMBEDDER names. It must be the one that mapping used.

        Raises:
            HypermapError: If the map's objects were not embedded, or by other encoders.
        """
        answer = self.ask({"like": text, "count": k}, encoder=encoder)
        return [*answer.objects]

    # Called by notebooks

    def _repr_html_(self) -> str:
        text: str = _outside("map_as_html")(self)
        return text

    def _repr_png_(self) -> bytes | None:
        picture: bytes | None = _outside("map_as_png")(self)
        return picture
