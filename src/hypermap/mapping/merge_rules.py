"""Which tracks may be merged, because they are of one object, and which of them is kept."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import shapely

from hypermap.mapping.evidence_buffer import CONFIRMED
from hypermap.mapping.footprint_iou import at_same_height
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.seen_sizes import hull_of_both, may_be_one
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import are_two

_SELDOM = 0.3  # share of the frames with one track that have the other, where that is a part of it
_SAME_PLACE = 0.5  # Jaccard index from which two published footprints are one object
_IN_A_ROW = 1.4  # times as long as the longer one, from which on two are beside each other


@dataclass(frozen=True, eq=False)
class MergeRules:
    """The rules of merging, for tracks of one class whose shapes match.

    Attributes:
        published: the tracks, as they would be published.
        observed: the ids of those that the present frame shows.
    """

    published: PublishedTracks
    observed: Collection[int]

    def mergeable(self, rows: Rows) -> Rows:
        """Return the rows that may be merged; the first one is kept.

        This is the oldest, but tracks edited by hand come before published ones, whose ids people
        may know, and these before others. Tracks deleted by hand are left out. Of those edited by
        hand, at most one is returned.
        """
        published, objects = self.published, self.published.tracks.objects
        rows = sorted(row for row in rows if not objects[row].is_deleted)
        if published.config.moves and rows:
            kept = next((row for row in rows if published.is_probable(row)), rows[0])
            rows = [kept, *(row for row in rows if row != kept)]
        edited = [row for row in rows if objects[row].by_hand is not None]
        return [*edited[:1], *(row for row in rows if row not in edited)] if edited else rows

    def are_one(self, row: int, match: int) -> bool:
        """Return whether two tracks may be one object: not if many frames show both.

        A few frames may show one object in two parts, if the tracks fill the same space; and more
        of them, if they are few of those that show the object. If any frame shows both, or they are
        in a row, they must together be no larger than one object is seen to be.
        """
        one, other = (self.published.tracks.objects[which] for which in (row, match))
        if other.id in self.observed:
            return False
        shown_together = one.co_occurrences[other.id]
        seldom, often = sorted([one.buffer.count, other.buffer.count])
        few = shown_together < CONFIRMED or seldom <= _SELDOM * often
        if are_two(one, other) and not (few and self._fill_one_place(row, match)):
            return False
        may_be_two = shown_together > 0 or self._are_in_a_row(row, match)
        return not may_be_two or self._have_size_of_one(row, match)

    def _are_in_a_row(self, row: int, match: int) -> bool:
        """Return whether two tracks are longer together than errors of poses make one object."""
        shapes = self.published.tracks.shapes
        one, other = shapes.polygons[row], shapes.polygons[match]
        length = hull_of_both(one, other).diameter
        longer = max(one.diameter, other.diameter)
        return length >= max(_IN_A_ROW * longer, longer + self.published.config.tolerance)

    def _have_size_of_one(self, row: int, match: int) -> bool:
        """Return whether two tracks together are no larger than one object is seen to be."""
        objects, shapes = self.published.tracks.objects, self.published.tracks.shapes
        name = objects[row].name
        return may_be_one(
            (objects[row], shapes.polygons[row]),
            (objects[match], shapes.polygons[match]),
            (track for track in objects if track.name == name),
            self.published.config.max_growth,
        )

    def _fill_one_place(self, row: int, match: int) -> bool:
        """Return whether two tracks would be published in the same place."""
        objects = self.published.tracks.objects
        if not at_same_height(*(objects[which].buffer.heights() for which in (row, match))):
            return False
        one, other = map(self.published.footprint, (row, match))
        shared = shapely.area(shapely.intersection(one, other))
        return bool(shared >= _SAME_PLACE * (one.area + other.area - shared))
