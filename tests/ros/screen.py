"""An X server without a monitor, and what a map looks like on it."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap.colors import class_colors
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.marker_array import tint
from hypermap.ros.rviz.config import RvizView

BACKGROUND = (226, 229, 233)
BLACK, WHITE = (0, 0, 0), (255, 255, 255)
_NO_COLOR = 999
_LIKE = 6  # of 255, how far a color may be off

Pixels = np.ndarray


class Screen:
    """A virtual screen; programs draw on it with `environment`."""

    def __init__(self, folder: Path, size: tuple[int, int] = (1400, 1000)) -> None:
        if shutil.which("Xvfb") is None or shutil.which("rviz") is None:
            pytest.skip("ROS 1 is not here (on Debian 12, as root: make ros1)")
        self._file = folder / "Xvfb_screen0"
        reader, writer = os.pipe()
        self._process = subprocess.Popen(
            [
                *("Xvfb", "-displayfd", str(writer), "-nolisten", "tcp", "-fbdir", str(folder)),
                *("-screen", "0", f"{size[0]}x{size[1]}x24"),
            ],
            pass_fds=[writer],
            stderr=subprocess.DEVNULL,
        )
        os.close(writer)
        with os.fdopen(reader) as number:
            display = f":{number.readline().strip()}"
        runtime = folder / "runtime"
        runtime.mkdir(mode=0o700)
        self.environment = {
            **os.environ,
            "DISPLAY": display,
            "HOME": str(folder),
            "XDG_RUNTIME_DIR": str(runtime),
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "QT_X11_NO_MITSHM": "1",
        }

    def pixels(self) -> Pixels:
        """Return what is on the screen, uint8, shape (height, width, 3).

        Source: XWDFile.h of X11: 25 big-endian numbers, a name, a color map, and the pixels.
        """
        content = self._file.read_bytes()
        head = struct.unpack(">25I", content[:100])
        size, width, height, row, colors = head[0], head[4], head[5], head[12], head[19]
        start = size + 12 * colors
        rows = np.frombuffer(content, np.uint8, height * row, start).reshape(height, row)
        return rows[:, : 4 * width].reshape(height, width, 4)[:, :, 2::-1]

    def close(self) -> None:
        self._process.terminate()
        self._process.wait()


class Seen:
    """A part of the floor as rviz shows it."""

    def __init__(self, pixels: Pixels, view: RvizView) -> None:
        is_background = np.logical_and.reduce([pixels[:, :, i] == BACKGROUND[i] for i in range(3)])
        self.is_drawn = bool(is_background.any())
        if self.is_drawn:
            rows, cols = (np.flatnonzero(is_background.any(axis=axis)) for axis in (1, 0))
            self._middle = (cols.min() + cols.max() + 1) / 2, (rows.min() + rows.max() + 1) / 2
        self._pixels, self._view = pixels, view

    def colors(self, points_xy: np.ndarray) -> np.ndarray:
        """Return the colors at points [m], shape (N, 3); none that exists beside the screen.

        A window that is half drawn has its middle elsewhere.
        """
        x, y = np.asarray(points_xy, dtype=float).reshape(-1, 2).T
        col = self._middle[0] + (x - self._view.x) * self._view.scale
        row = self._middle[1] - (y - self._view.y) * self._view.scale
        height, width = self._pixels.shape[:2]
        is_on = (row >= 0) & (row < height) & (col >= 0) & (col < width)
        colors = np.full((len(x), 3), _NO_COLOR)
        colors[is_on] = self._pixels[row[is_on].astype(int), col[is_on].astype(int)]
        return colors

    def share(self, points_xy: np.ndarray, expected: np.ndarray) -> float:
        """Return the share of points that have their expected color (N, 3): of the worst color."""
        if not self.is_drawn:
            return 0.0
        is_right = np.abs(self.colors(points_xy) - expected).max(axis=1) <= _LIKE
        numbers = expected @ (1 << 16, 1 << 8, 1)
        return min(float(is_right[numbers == number].mean()) for number in np.unique(numbers))

    def has_ink(self, x: float, y: float, height: float) -> bool:
        """Whether letters of that height stand around a point [m]."""
        if not self.is_drawn:
            return False
        near = np.stack(np.meshgrid(*[np.linspace(-height, height, 40)] * 2), axis=-1)
        return bool((self.colors(near.reshape(-1, 2) + np.array([x, y])).max(axis=1) < 60).any())


def expected(
    hypermap: Hypermap, grid: str, hidden: tuple[str, ...] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Return points (N, 2) all over a grid in the base frame, and the color of each (N, 3).

    Points near edges, names and the lines of the ground are left out.
    """
    layer = hypermap[grid]
    assert isinstance(layer, OccupancyLayer)
    x0, y0, x1, y1 = layer.extent().bounds
    points = np.random.default_rng(1).uniform((x0, y0), (x1, y1), (20000, 2))
    near = 0.06
    cells = (points - (x0, y0)) / layer.grid.resolution % 1 * layer.grid.resolution
    keep = (np.minimum(cells, layer.grid.resolution - cells) > near).all(axis=1)
    keep &= (np.abs(points - np.round(points)) > near).all(axis=1)
    colors = np.where((layer.value_at(points) == 100)[:, None], BLACK, WHITE)
    places = shapely.points(points)
    semantic = [item for item in hypermap if isinstance(item, SemanticLayer)]
    palette = class_colors(name for item in semantic for name in item.names)
    shapes = []
    for item in semantic:
        base_T_layer = hypermap.frames.lookup(hypermap.base_frame, item.frame_id)
        for name, footprint in zip(item.names, item.geometries, strict=True):
            if name not in hidden:
                shapes.append((name, base_T_layer.apply_geometry(footprint)))
    for name, shape in sorted(shapes, key=lambda pair: -pair[1].area):
        colors[shapely.covers(shape, places)] = rgb(palette[name])
        keep &= shapely.distance(shape.boundary, places) > near
        label = shape.centroid if shape.covers(shape.centroid) else shape.point_on_surface()
        aside, above = np.abs(points - shapely.get_coordinates(label)).T
        keep &= (aside > 0.1 * len(name)) | (above > 0.12)
    wanted = [rgb(palette[name]) for name, _ in shapes]
    for color in (*wanted, BLACK, WHITE):
        assert (colors[keep] == color).all(axis=1).sum() > 20
    return points[keep], colors[keep]


def rgb(color: tuple[float, float, float]) -> np.ndarray:
    """Return the color 0..255 in which objects of a class are filled."""
    return np.round(255 * np.array(tint(color))).astype(int)
