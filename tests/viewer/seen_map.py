"""A small room of which it is known what each thing was made of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from hypermap.core.evidence import EvidenceTable
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import save_map

from .small_map import CHAIR, CUP, DESK, small_map

START = 100.0
STAMPS = START + np.array([0.0, 2.0, 5.0, 65.0])
SCORES = np.array([0.9, 0.5, 0.75, 0.25])
# Two whole looks at the chair (6.5..7.5, 4.5..5.5), one at its left half, and one far too wide.
CHAIR_LOOKS = [
    shapely.box(6.5, 4.5, 7.5, 5.5),
    shapely.box(6.5, 4.5, 7.0, 5.5),
    shapely.box(6.5, 4.5, 7.5, 5.5),
    shapely.box(6.5, 4.5, 8.0, 5.5),
]
CAMERAS_XY = [(5.0, 5.0), (5.5, 6.0), (6.0, 7.0), (9.0, 5.0)]


def looking(x: float, y: float, toward: tuple[float, float]) -> np.ndarray:
    """Return the pose of a camera that looks level toward a point."""
    ahead = np.array([toward[0] - x, toward[1] - y, 0.0])
    ahead /= np.linalg.norm(ahead)
    down = np.array([0.0, 0.0, -1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([np.cross(down, ahead), down, ahead])
    pose[:3, 3] = x, y, 1.2
    return pose


def evidence() -> EvidenceTable:
    """Four looks at the chair; the first view shows the desk, too."""
    shapes = [*CHAIR_LOOKS, shapely.box(2, 2.5, 4, 3.5)]
    return EvidenceTable(
        object_ids=np.array([CHAIR] * 4 + [DESK]),
        views=np.array([0, 1, 2, 3, 0]),
        scores=np.append(SCORES, 0.6),
        footprints=np.array(shapes, dtype=object),
        heights=np.array([[0.1, 0.8]] * 5),
        stamps=STAMPS,
        poses=np.array([looking(x, y, (7.0, 5.0)) for x, y in CAMERAS_XY]),
        areas=np.array([shapely.box(0, 0, 10, 8)] * 4, dtype=object),
    )


def seen_map(*, is_turned: bool = False) -> Hypermap:
    """Return the small map with evidence; its objects may lie in a frame that is turned."""
    plain = small_map()
    objects = plain["semantic"].objects()
    frame = "lab" if is_turned else "map"
    layer = SemanticLayer("semantic", frame, objects, evidence=evidence())
    frames = FrameTree([Transform("map", "lab", Pose2D(1.0, 0.0, np.pi / 2))])
    metadata = {"config": {"evidence": {"fusion": "votes"}}}
    return Hypermap([plain["occupancy"], layer], frames if is_turned else None, metadata)


def saved_seen_map(folder: Path) -> Path:
    path = folder / "seen.hmap"
    save_map(seen_map(), path)
    return path


HAS_NONE = CUP
