"""Colors of tracks: which two are surely not one object, whatever the light of the day.

Source: the gains of each channel between two drives are a diagonal (von Kries) adaptation, as in
Finlayson et al., "Diagonal transforms suffice for color constancy", ICCV 1993; colors are compared
in CIELAB (CIE 15:2004) by their Euclidean distance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.mapping.evidence_buffer import STALE, EvidenceBuffer, SeenColor
from hypermap.mapping.tracks import Track, TrackTable

SAME_COLOR = 12.0
"""Distance in CIELAB up to which two views may be of one object."""

_SHADE = 3.0  # times as bright as in another view, with another side in the light
_OFTEN = 0.3  # share of a drive's views that show a side, at least: others are of other things
_PLAIN = 0.5  # share of a drive's views in one color, at least: few may show one side only
_COMMON = 3  # objects in two drives from which the light of one is known from the other's
_DARK = 0.002  # added to linear channels, whose ratios say little where they are nearly 0
_UNKNOWN = np.full(3, np.nan)

_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
)  # of linear sRGB, IEC 61966-2-1
_WHITE = _XYZ.sum(axis=1)


def differ_in_color(tracks: TrackTable, before: Sequence[int], now: Sequence[int]) -> BoolArray:
    """Return which pairs of tracks have such different colors that they are two objects.

    Returns:
        Of the rows `before` and `now`, as in `color_distances`, shape (N, M); False where a color
        is unknown.
    """
    return color_distances(tracks, before, now) > SAME_COLOR


def objects_differ_in_color(tracks: TrackTable, before: int, now: int) -> bool:
    """Return the same of the objects with two ids; False if the table has one of them no more."""
    rows = tracks.rows_of([before]), tracks.rows_of([now])
    return bool(differ_in_color(tracks, *rows).any())


def color_distances(
    tracks: TrackTable,
    before: Sequence[int],
    now: Sequence[int],
    same: Mapping[int, int] | None = None,
) -> NDArray[np.float64]:
    """Return how far apart the colors of tracks are, in CIELAB.

    What all objects of two drives have in common is the light, or the camera, and does not count.
    An object has shown the sides that it has, as the seat and the legs of a bench: the nearest
    colors of any of its views count.

    Args:
        tracks: all tracks.
        before: rows of tracks that are gone, N.
        now: rows of tracks that have come, M.
        same: rows of tracks of the newest drive that surely are of one object with others, by the
            rows of these.

    Returns:
        Shape (N, M); NaN where a color is unknown, or the light of the newest one.
    """
    distances = np.full((len(before), len(now)), np.nan)
    if not distances.size:
        return distances
    sides = [_newest_sides(_paints(tracks.objects[row].buffer)) for row in now]
    seen, starts = np.concatenate(sides), np.cumsum([0, *map(len, sides[:-1])])
    gains = _Gains(tracks, same or {})
    for i, row in enumerate(before):
        known = [paint.sides * gains.since(paint) for paint in _while_there(tracks.objects[row])]
        if known and not np.isnan(known[-1]).any():
            nearest = np.fmin.reduce(_distances(np.concatenate(known), seen), axis=0)
            distances[i] = np.fmin.reduceat(nearest, starts)
    return distances


def _distances(expected: NDArray[np.float64], seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far apart linear colors are in CIELAB, whichever side is in the light.

    Args:
        expected: 0..1, NaN for unknown ones, shape (N, 3).
        seen: likewise, shape (M, 3).

    Returns:
        Shape (N, M), NaN where one is unknown.
    """
    expected, seen = expected[:, np.newaxis], seen[np.newaxis]
    ratios = np.median((seen + _DARK) / (expected + _DARK), axis=2, keepdims=True)
    half = np.sqrt(np.clip(ratios, 1 / _SHADE, _SHADE))
    away: NDArray[np.float64] = np.linalg.norm(_lab(expected * half) - _lab(seen / half), axis=2)
    return away


class _Paint(NamedTuple):
    """The color of an object in one drive.

    Attributes:
        first: stamp of the first frame from which it is known [s].
        last: of the last one [s].
        color: the median of its views, linear sRGB, 0..1, shape (3,).
        sides: those of single views that enough others are like, shape (N, 3); never none.
    """

    first: float
    last: float
    color: NDArray[np.float64]
    sides: NDArray[np.float64]


def _paints(buffer: EvidenceBuffer) -> tuple[_Paint, ...]:
    """Return the color of an object in each drive of which it is known, oldest first.

    It is not known where most views are of several colors, as of a plant in its pot.
    """
    return _paints_of(buffer.colors)


@lru_cache(maxsize=2000)
def _paints_of(colors: tuple[SeenColor, ...]) -> tuple[_Paint, ...]:
    ends = [i + 1 for i, (a, b) in enumerate(pairwise(colors)) if b.stamp - a.stamp > STALE]
    parts = [colors[i:j] for i, j in pairwise([0, *ends, len(colors)]) if j > i]
    plain = [[one for one in part if one.rgb is not None] for part in parts]
    pairs = zip(parts, plain, strict=True)
    return tuple(_paint_of(some) for part, some in pairs if len(some) >= _PLAIN * len(part) > 0)


def _paint_of(colors: Sequence[SeenColor]) -> _Paint:
    rgb = np.array([color.rgb for color in colors], float)
    color, views = _linear(np.median(rgb, axis=0)), _linear(rgb)
    share = (_distances(views, views) <= SAME_COLOR).mean(axis=1)
    sides = views[share >= min(_OFTEN, share.max())]
    return _Paint(colors[0].stamp, colors[-1].stamp, color, sides)


def _newest_sides(paints: Sequence[_Paint]) -> NDArray[np.float64]:
    return paints[-1].sides if paints else _UNKNOWN[np.newaxis]


def _while_there(track: Track) -> list[_Paint]:
    """Return the colors of an object from while it surely was there, oldest first."""
    end = track.buffer.surely_there[1]
    return [paint for paint in _paints(track.buffer) if paint.first <= end]


class _Gains:
    """By how much each channel is brighter in the newest drive than in earlier ones."""

    def __init__(self, tracks: TrackTable, same: Mapping[int, int]) -> None:
        paints = [_paints(one.buffer) for one in tracks.objects]
        for row, other in same.items():
            paints[row] = (*paints[row], *paints[other])
        self._paints = [found for found in paints if found]
        self._newest = max((paints[-1].last for paints in self._paints), default=-np.inf)
        self._known: list[tuple[float, NDArray[np.float64]]] = []

    def since(self, paint: _Paint) -> NDArray[np.float64]:
        """Return the gains since the drive of a color, shape (3,); NaN if they are unknown."""
        if paint.last > self._newest - STALE:
            return np.ones(3)
        for stamp, gains in self._known:
            if abs(stamp - paint.last) < STALE:
                return gains
        self._known.append((paint.last, self._between(paint.last)))
        return self._known[-1][1]

    def _between(self, stamp: float) -> NDArray[np.float64]:
        ratios = [
            (paints[-1].color + _DARK) / (then.color + _DARK)
            for paints in self._paints
            if paints[-1].last > self._newest - STALE
            for then in paints[:-1]
            if then.first - STALE < stamp < then.last + STALE
        ]
        return np.median(ratios, axis=0) if len(ratios) >= _COMMON else _UNKNOWN


def _linear(color: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an sRGB color, 0..255, as linear values, 0..1; source: IEC 61966-2-1."""
    c = color / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def _lab(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return colors of linear sRGB, 0..1, in CIELAB, shape (..., 3) both."""
    t = (linear @ _XYZ.T) / _WHITE
    delta = 6 / 29
    f = np.where(t > delta**3, np.cbrt(t), t / (3 * delta**2) + 4 / 29)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)
