"""Whether depth is registered to color: depth edges should be color edges.

Depth jumps at the outlines of objects, where color mostly changes, too. In registered images, depth
edges lie on color edges. In images of two cameras they do so only after projection into the color
camera, so the images reveal how it is mounted.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.core.errors import HypermapError
from hypermap.perception.frame import Camera, RgbdFrame

_COLUMNS = 320  # of the images that are compared, about
_FRAMES = 8  # to compare
_EVERY = 3  # frames
_JUMP = 1.08  # least ratio of the depths on both sides of an outline
_ACROSS = 8  # pixels without depth that may be between them
_POINTS = 150  # of the outlines of each frame, per direction
_FEWEST_FRAMES = 6  # of 4 or 5 frames of a registered recording, 1 of 9 samples look shifted
_FEWEST_POINTS = 600
_BLUR = 1.2  # pixels; tolerance between an outline and its color edge
_STRONG = 95.0  # percentile at which the strength of color edges is capped
_LEAST = 0.05  # least excess strength of edges at outlines, as a share of a full edge
_BETTER = 1.3  # times as many edges must match as in the unchanged images
_LEAST_SHIFT = 0.006  # of the image's width: 4 pixels of 640
_SCALES = np.arange(0.80, 1.2401, 0.04)  # of the color camera's focal length over the other's
_BASELINES = np.arange(-0.08, 0.0801, 0.02)  # meters along x
_STEPS = {"scale": 0.01, "x": 0.005, "y": 0.005}


@dataclass(frozen=True)
class ColorCamera:
    """The pose of the color camera, estimated from color edges.

    Attributes:
        is_other: whether the images clearly are not registered.
        scale: its focal length over that of the depth camera.
        x: position of the depth camera in it [m], to the right.
        y: position of the depth camera in it [m], downward.
        shift: median distance of the same place in both images, as a share of their width.
        camera: the depth camera.
    """

    is_other: bool
    scale: float
    x: float
    y: float
    shift: float
    camera: Camera

    @property
    def intrinsics(self) -> tuple[float, float, float, float]:
        """Its fx, fy, cx, cy [pixels], for color images of the depth images' size."""
        K = self.camera.K
        fx, fy = self.scale * K[0, 0], self.scale * K[1, 1]
        return float(fx), float(fy), float(K[0, 2]), float(K[1, 2])


@dataclass(frozen=True, eq=False)
class _Sample:
    """Outlines of a frame, as rays with depth, and the strength of its color edges.

    Attributes:
        outlines: for each point 0 for a vertical edge or 1 for a horizontal one, x and y of its ray
            at 1 m, and its depth [m], shape (N, 4).
        edges: strength of vertical and horizontal edges, with mean 0, float32, shape (2, H, W).
        K: intrinsics of these smaller images, shape (3, 3).
    """

    outlines: NDArray[np.float64]
    edges: NDArray[np.float32]
    K: NDArray[np.float64]


class RegistrationCheck:
    """Samples frames with color, and matches depth edges with color edges."""

    def __init__(self) -> None:
        self._samples: list[_Sample] = []
        self._camera: Camera | None = None
        self._shape: tuple[int, int] | None = None
        self._seen = 0
        self._rng = np.random.default_rng(0)

    def add(self, frame: RgbdFrame) -> None:
        """Sample a frame with color, which is decoded, until there are enough samples.

        A frame whose color cannot be read counts as one without color.
        """
        self._seen += 1
        if len(self._samples) == _FRAMES or (self._seen - 1) % _EVERY:
            return
        try:
            color = frame.color
        except HypermapError:
            return
        shape = frame.camera.height, frame.camera.width
        if color is None or self._shape not in (shape, None):
            return
        self._camera, self._shape = frame.camera, shape
        sample = _sample(frame, color, self._rng)
        if sample is None:
            return
        self._samples.append(sample)

    def color_camera(self) -> ColorCamera | None:
        """Return the color camera; None if too few outlines were seen."""
        count = sum(len(sample.outlines) for sample in self._samples)
        if self._camera is None or len(self._samples) < _FEWEST_FRAMES or count < _FEWEST_POINTS:
            return None
        met = _Met(self._samples)
        as_it_is = met.share(1.0, 0.0, 0.0)
        tried = product(_SCALES, _BASELINES)
        scale, x = max(tried, key=lambda at: met.share(at[0], at[1], 0.0))
        best = met.climb(float(scale), float(x), 0.0)
        share, shift = met.share(*best), met.shift(*best)
        if max(share, as_it_is) < _LEAST:
            return None
        is_other = share > _BETTER * as_it_is and shift > _LEAST_SHIFT
        return ColorCamera(is_other, *best, shift, self._camera)


class _Met:
    """How well depth edges match color edges."""

    def __init__(self, samples: list[_Sample]) -> None:
        self._edges = np.array([sample.edges for sample in samples])
        self._K = samples[0].K
        counts = [len(sample.outlines) for sample in samples]
        self._of = np.repeat(np.arange(len(samples)), counts)
        kinds, *self._rays = np.concatenate([sample.outlines for sample in samples]).T
        self._kinds = kinds.astype(int)

    def share(self, scale: float, x: float, y: float) -> float:
        """Return the mean strength of the edges at the outlines; 0 is the expectation by chance."""
        columns, rows = (np.rint(at).astype(int) for at in self._pixels(scale, x, y))
        height, width = self._edges.shape[2:]
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        of, kinds = self._of[inside], self._kinds[inside]
        met = self._edges[of, kinds, rows[inside], columns[inside]]
        return float(np.sum(met) / len(self._of))  # points outside the image match nothing

    def climb(self, scale: float, x: float, y: float) -> tuple[float, float, float]:
        """Return the values near these with the highest `share` (hill climbing)."""
        at, best = np.array([scale, x, y]), self.share(scale, x, y)
        for step in (1.0, 1.0, 0.4):
            for k, size in enumerate(_STEPS.values()):
                for sign in (-1, 1):
                    while True:
                        tried = at.copy()
                        tried[k] += sign * step * size
                        share = self.share(tried[0], tried[1], tried[2])
                        if share <= best or abs(tried[k] - (scale, x, y)[k]) > 10 * size:
                            break
                        at, best = tried, share
        return float(at[0]), float(at[1]), float(at[2])

    def shift(self, scale: float, x: float, y: float) -> float:
        """Return the median displacement of the outlines, as a share of the image's width."""
        moved = np.array(self._pixels(scale, x, y)) - np.array(self._pixels(1.0, 0.0, 0.0))
        return float(np.median(np.hypot(moved[0], moved[1])) / self._edges.shape[3])

    def _pixels(
        self, scale: float, x: float, y: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the columns and rows of the outlines in such a color camera, shape (N,) each."""
        (right, down, depth), K = self._rays, self._K
        columns = scale * K[0, 0] * (right + x / depth) + K[0, 2]
        return columns, scale * K[1, 1] * (down + y / depth) + K[1, 2]


def _sample(frame: RgbdFrame, color: NDArray[np.uint8], rng: np.random.Generator) -> _Sample | None:
    """Return the outlines and edges of a frame; None if it has too few."""
    step = max(1, round(frame.camera.width / _COLUMNS))
    K, z = frame.camera.every(step).K, frame.z[::step, ::step]
    gray = color[::step, ::step].astype(np.float32).sum(axis=2)
    edges = []
    for axis in (1, 0):
        slope = np.abs(scipy.ndimage.gaussian_filter(gray, _BLUR, order=(1 - axis, axis)))
        strong = float(np.percentile(slope, _STRONG))
        if strong == 0:
            return None
        share = np.minimum(slope / strong, 1.0)
        edges.append(share - share.mean())
    rows, columns = _outlines(z)
    other_columns, other_rows = _outlines(np.ascontiguousarray(z.T))
    outlines = []
    for kind, (v, u) in enumerate(((rows, columns), (other_rows, other_columns))):
        chosen = rng.permutation(len(v))[:_POINTS]
        v, u = v[chosen], u[chosen]
        x, y = (u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1]
        outlines.append(np.column_stack([np.full(len(v), kind), x, y, z[v, u]]))
    return _Sample(np.concatenate(outlines), np.array(edges, np.float32), K)


def _outlines(z: NDArray[np.float32]) -> tuple[IntArray, IntArray]:
    """Return rows and columns of the pixels next to a jump to larger depth."""
    valid = np.flatnonzero((z > 0) & (z < np.inf))
    depth, width = z.ravel()[valid], z.shape[1]
    neighbors = (np.diff(valid) <= _ACROSS) & (valid[1:] // width == valid[:-1] // width)
    ends = neighbors & (depth[1:] > _JUMP * depth[:-1])
    begins = neighbors & (depth[:-1] > _JUMP * depth[1:])
    rows, columns = np.divmod(np.concatenate([valid[:-1][ends], valid[1:][begins]]), width)
    return rows, columns
