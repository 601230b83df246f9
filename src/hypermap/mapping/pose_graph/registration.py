"""Registration of one view to another: iterative closest points, in x, y and yaw.

Source: correspondences by projection as in Blais and Levine, "Registering multiview range data to
create 3D computer objects", PAMI 1995; distances from points to planes by Chen and Medioni, "Object
modelling by registration of multiple range images", 1992; weights of Tukey.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hypermap._loops import loop
from hypermap.mapping.pose_graph.planar import Array
from hypermap.mapping.pose_graph.view import Floats, View

_REACHES = np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.06, 0.06, 0.06, 0.06])
# meters from plane to point up to which they may belong together, in each step
_FEWEST = 60  # points that a registration needs
_TOGETHER = 10.0  # points with one common error
_FLOOR = np.array([0.003, 0.003, 0.001])  # standard deviations below which none is [m, m, rad]
_CONTRADICTS = 0.1  # meters by which a surface is seen through


@dataclass(frozen=True, eq=False)
class Registration:
    """How one view lies on another.

    Attributes:
        a_T_b: x, y, yaw of the second in the first [m, m, rad], shape (3,).
        information: inverse of its covariance, shape (3, 3).
        overlap: share of the second view's upright points that the first one could show.
        agreement: share of those that lie on a surface of the first one, of all that do, or through
            which it saw.
    """

    a_T_b: Array
    information: Array
    overlap: float
    agreement: float


def register(
    first: View, second: View, a_T_b: Array, reaches: Array = _REACHES
) -> Registration | None:
    """Return how the second view lies on the first; None if they share too little.

    Args:
        first: a view.
        second: another one, of the same things.
        a_T_b: where the second is in the first, about.
        reaches: of each step, see above.
    """
    if len(second.upright) < _FEWEST:
        return None
    pose, information, counts = a_T_b.astype(float), np.zeros((3, 3)), np.zeros(4)
    _iterate(
        second.upright,
        second.upright_normals,
        first.points,
        first.normals,
        np.ascontiguousarray(first.level_R_camera),
        first.height,
        first.intrinsics,
        reaches,
        pose,
        information,
        counts,
    )
    visible, agreeing, through, used = counts
    if used < _FEWEST or not np.isfinite(pose).all():
        return None
    information = _positive(information) / _TOGETHER
    # Covariances add up, also where the information about a direction is none.
    information -= information @ np.linalg.solve(information + np.diag(_FLOOR**-2.0), information)
    return Registration(
        pose,
        (information + information.T) / 2,
        visible / len(second.upright),
        agreeing / max(agreeing + through, 1),
    )


def _positive(information: Array) -> Array:
    """Return the matrix without directions about which it knows less than nothing."""
    values, vectors = np.linalg.eigh((information + information.T) / 2)
    return np.asarray((vectors * np.maximum(values, 0)) @ vectors.T)


@loop()
def _iterate(
    points: Floats,
    normals: Floats,
    on_points: Floats,
    on_normals: Floats,
    level_R_camera: Array,
    height: float,
    intrinsics: Array,
    reaches: Array,
    pose: Array,
    information: Array,
    counts: Array,
) -> None:
    """Refine a pose by Gauss-Newton steps.

    Args:
        points: to be moved [m], shape (N, 3).
        normals: of their surfaces, shape (N, 3).
        on_points: the image onto which they are moved [m], shape (H, W, 3).
        on_normals: of its surfaces, shape (H, W, 3).
        level_R_camera: its rotation, shape (3, 3).
        height: of its camera [m].
        intrinsics: of its blocks, shape (4,).
        reaches: of the steps [m], shape (S,).
        pose: x, y, yaw; changed, shape (3,).
        information: filled in, without regard to points that err together, shape (3, 3). Each
            point's normals are from both views, whose errors have nothing in common: those of one
            would tell of a motion along a wall.
        counts: filled in: visible, agreeing, seen through, used; shape (4,).
    """
    R = level_R_camera
    rows, columns = on_points.shape[:2]
    for step in range(len(reaches) + 1):
        is_last = step == len(reaches)
        reach = reaches[min(step, len(reaches) - 1)]
        a00 = a01 = a02 = a11 = a12 = a22 = b0 = b1 = b2 = 0.0
        visible = agreeing = through = used = 0
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        for i in range(len(points)):
            rx = cos * points[i, 0] - sin * points[i, 1]
            ry = sin * points[i, 0] + cos * points[i, 1]
            x, y, z = rx + pose[0], ry + pose[1], points[i, 2]
            h = z - height
            depth = R[0, 2] * x + R[1, 2] * y + R[2, 2] * h
            if depth < 0.2:
                continue
            across = R[0, 0] * x + R[1, 0] * y + R[2, 0] * h
            down = R[0, 1] * x + R[1, 1] * y + R[2, 1] * h
            column = int(np.floor(intrinsics[0] * across / depth + intrinsics[2] + 0.5))
            row = int(np.floor(intrinsics[1] * down / depth + intrinsics[3] + 0.5))
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            qx, qy, qz = on_points[row, column]
            if not np.isfinite(qx):
                continue
            visible += 1
            there = R[0, 2] * qx + R[1, 2] * qy + R[2, 2] * (qz - height)
            nx, ny, nz = on_normals[row, column]
            distance = nx * (x - qx) + ny * (y - qy) + nz * (z - qz)  # NaN without a normal
            mx = cos * normals[i, 0] - sin * normals[i, 1]
            my = sin * normals[i, 0] + cos * normals[i, 1]
            same_side = nx * mx + ny * my + nz * normals[i, 2] > 0.8
            if same_side and abs(distance) < reach:
                agreeing += 1
                sigma = 0.005 + 0.001 * depth * depth
                inlier = 1 - (distance / reach) ** 2
                weight = inlier * inlier / (sigma * sigma)
                turn = ny * rx - nx * ry
                if is_last:
                    mturn = my * rx - mx * ry
                    a00 += weight * nx * mx
                    a01 += weight * (nx * my + mx * ny) / 2
                    a02 += weight * (nx * mturn + mx * turn) / 2
                    a11 += weight * ny * my
                    a12 += weight * (ny * mturn + my * turn) / 2
                    a22 += weight * turn * mturn
                    used += 1
                    continue
                a00 += weight * nx * nx
                a01 += weight * nx * ny
                a02 += weight * nx * turn
                a11 += weight * ny * ny
                a12 += weight * ny * turn
                a22 += weight * turn * turn
                b0 -= weight * nx * distance
                b1 -= weight * ny * distance
                b2 -= weight * turn * distance
                used += 1
            elif depth < there - _CONTRADICTS - 0.01 * there * there:
                through += 1
        if is_last or used < 20:
            information[0, 0], information[0, 1], information[0, 2] = a00, a01, a02
            information[1, 0], information[1, 1], information[1, 2] = a01, a11, a12
            information[2, 0], information[2, 1], information[2, 2] = a02, a12, a22
            counts[0], counts[1], counts[2], counts[3] = visible, agreeing, through, used
            return
        # A weak pull to where it is keeps directions of which nothing is known.
        a00 += 100.0
        a11 += 100.0
        a22 += 100.0
        c0, c1, c2 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
        c4, c5, c8 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
        det = a00 * c0 + a01 * c1 + a02 * c2
        pose[0] += (c0 * b0 + c1 * b1 + c2 * b2) / det
        pose[1] += (c1 * b0 + c4 * b1 + c5 * b2) / det
        pose[2] += (c2 * b0 + c5 * b1 + c8 * b2) / det
