"""Registration of one view to another: iterative closest points, in x, y and yaw.

Source: correspondences by projection as in Blais and Levine, "Registering multiview range data to
create 3D computer objects", PAMI 1995; distances from points to planes by Chen and Medioni, "Object
modelling by registration of multiple range images", 1992, with the mean normal of both views
(Rusinkiewicz, "A symmetric objective function for ICP", TOG 38(4), 2019); weights of Tukey.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hypermap._loops import inner_loop, loop
from hypermap.mapping.pose_graph.planar import Array
from hypermap.mapping.pose_graph.view import Floats, View

_REACHES = np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.1, 0.06, 0.06, 0.06, 0.06])
# meters; largest distance of a correspondence from point to plane, in each step
_FEWEST = 60  # points that a registration needs
_TOGETHER = 10.0  # points with a common error: so many count as one
_FLOOR = np.array([0.003, 0.003, 0.001])  # added standard deviations [m, m, rad]
_VAGUE = 0.06  # standard deviation [m]; a direction known less well gets the next one
_UNKNOWN = 1.0  # [m]
_MATRIX = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])  # indices of a symmetric matrix in `sums`
_CONTRADICTS = 0.1  # meters; a ray that ends so far behind a point contradicts it


@dataclass(frozen=True, eq=False)
class Registration:
    """The relative pose of two views.

    Attributes:
        a_T_b: x, y, yaw of the second in the first [m, m, rad], shape (3,).
        information: inverse of its covariance, shape (3, 3).
        overlap: share of the second view's upright points that are in the first one's image.
        agreement: number of these on a surface of the first view, over the number of these on one
            or contradicted by it, 0..1.
    """

    a_T_b: Array
    information: Array
    overlap: float
    agreement: float


def register(
    first: View, second: View, a_T_b: Array, reaches: Array = _REACHES
) -> Registration | None:
    """Return the pose of the second view in the first; None if they overlap too little.

    Args:
        first: a view.
        second: another view of the same place.
        a_T_b: approximate pose of the second in the first [m, m, rad], shape (3,).
        reaches: largest distances of correspondences in each step [m], shape (S,).
    """
    if len(second.upright) < _FEWEST:
        return None
    pose, sums, counts = a_T_b.astype(float), np.zeros(9), np.zeros(4)
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
        sums,
        counts,
    )
    visible, agreeing, through, used = counts
    if used < _FEWEST or not np.isfinite(pose).all():
        return None
    information = _positive(sums[_MATRIX]) / _TOGETHER
    # Add a covariance; this form also works without information about a direction.
    information -= information @ np.linalg.solve(information + np.diag(_FLOOR**-2.0), information)
    return Registration(
        pose,
        _without_vague((information + information.T) / 2),
        visible / len(second.upright),
        agreeing / max(agreeing + through, 1),
    )


def vague_direction(information: Array) -> Array | None:
    """Return the direction in which a position is hardly known, as along a bare wall, shape (2,).

    None if there is none.
    """
    values, vectors = _directions(information)
    return np.asarray(vectors[:, 0]) if values[0] < _VAGUE**-2.0 else None


def _without_vague(information: Array) -> Array:
    """Return an information matrix without what is hardly known, as along a bare wall.

    There a registration goes where noise leads it: a little too far, always the same way, which
    adds up over many matches. What is known about other directions stays.

    Source: Zhang, Kaess, Singh, "On degeneracy of optimization-based state estimation problems",
    ICRA 2016, who leave out such directions, too.
    """
    values, vectors = _directions(information)
    for value, direction in zip(values, vectors.T, strict=True):
        if value < _VAGUE**-2.0:  # add a covariance, as above
            along = information[:, :2] @ direction
            known = direction @ along[:2]
            information = information - np.outer(along, along) / (known + _UNKNOWN**-2.0)
    return information


def _directions(information: Array) -> tuple[Array, Array]:
    """Return what is known of a position whatever the heading is: (2,), and in columns (2, 2)."""
    by_yaw = information[:2, 2:] / max(information[2, 2], 1e-9)
    values, vectors = np.linalg.eigh(information[:2, :2] - by_yaw @ information[2:, :2])
    return values, vectors


def _positive(information: Array) -> Array:
    """Return the nearest symmetric matrix without negative eigenvalues."""
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
    sums: Array,
    counts: Array,
) -> None:
    """Refine a pose by Gauss-Newton steps.

    Args:
        points: to be moved [m], shape (N, 3).
        normals: of their surfaces, shape (N, 3).
        on_points: the image onto which they are moved [m], shape (H, W, 3).
        on_normals: of its surfaces, shape (H, W, 3).
        level_R_camera: rotation of its camera, shape (3, 3).
        height: of its camera [m].
        intrinsics: fx, fy, cx, cy of the image, shape (4,).
        reaches: of the steps [m], shape (S,).
        pose: x, y, yaw [m, m, rad]; changed, shape (3,).
        sums: filled in: the upper triangle of the information matrix, row by row, as if all points
            had independent errors, and three numbers more; shape (9,).
        counts: filled in: visible, agreeing, seen through, used; shape (4,).
    """
    for step in range(len(reaches) + 1):
        is_last = step == len(reaches)
        reach = reaches[min(step, len(reaches) - 1)]
        sums[:] = 0.0
        counts[:] = 0.0
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        for i in range(len(points)):
            rx = cos * points[i, 0] - sin * points[i, 1]
            ry = sin * points[i, 0] + cos * points[i, 1]
            x, y, z = rx + pose[0], ry + pose[1], points[i, 2]
            row, column, depth = _pixel(
                x, y, z - height, level_R_camera, intrinsics, on_points.shape[:2]
            )
            if row < 0:
                continue
            qx, qy, qz = on_points[row, column]
            if not np.isfinite(qx):
                continue
            counts[0] += 1
            nx, ny, nz = on_normals[row, column]
            distance = nx * (x - qx) + ny * (y - qy) + nz * (z - qz)  # NaN without a normal
            mx = cos * normals[i, 0] - sin * normals[i, 1]
            my = sin * normals[i, 0] + cos * normals[i, 1]
            same_side = nx * mx + ny * my + nz * normals[i, 2] > 0.8
            if same_side and abs(distance) < reach:
                counts[1] += 1
                weight = _weight(distance / reach, depth)
                turn, mturn = ny * rx - nx * ry, my * rx - mx * ry
                if is_last:
                    _add_information(sums, weight, nx, ny, turn, mx, my, mturn)
                else:  # each view's noise is in its normals, too, and both cancel out
                    sx, sy, sz = (nx + mx) / 2, (ny + my) / 2, (nz + normals[i, 2]) / 2
                    apart = sx * (x - qx) + sy * (y - qy) + sz * (z - qz)
                    _add_equation(sums, weight, sx, sy, sy * rx - sx * ry, apart)
                continue
            R = level_R_camera
            there = R[0, 2] * qx + R[1, 2] * qy + R[2, 2] * (qz - height)
            if depth < there - _CONTRADICTS - 0.01 * there * there:
                counts[2] += 1
        counts[3] = counts[1]
        if is_last or counts[3] < 20:
            return
        _move(pose, sums)


@inner_loop()
def _pixel(
    x: float, y: float, h: float, R: Array, intrinsics: Array, shape: tuple[int, int]
) -> tuple[int, int, float]:
    """Return the row, column and depth at which a camera sees a point; row -1 if it does not.

    Args:
        x: of the point from the camera, in level axes [m].
        y: likewise.
        h: likewise, up.
        R: level_R_camera.
        intrinsics: fx, fy, cx, cy.
        shape: rows and columns of the image.
    """
    depth = R[0, 2] * x + R[1, 2] * y + R[2, 2] * h
    if depth < 0.2:
        return -1, -1, depth
    across = R[0, 0] * x + R[1, 0] * y + R[2, 0] * h
    down = R[0, 1] * x + R[1, 1] * y + R[2, 1] * h
    column = int(np.floor(intrinsics[0] * across / depth + intrinsics[2] + 0.5))
    row = int(np.floor(intrinsics[1] * down / depth + intrinsics[3] + 0.5))
    if not (0 <= row < shape[0] and 0 <= column < shape[1]):
        return -1, -1, depth
    return row, column, depth


@inner_loop()
def _weight(share: float, depth: float) -> float:
    """Return Tukey's weight of a distance, as a share of the largest, over its variance."""
    sigma = 0.005 + 0.001 * depth * depth
    inlier = 1 - share**2
    return inlier * inlier / (sigma * sigma)


@inner_loop()
def _add_equation(
    sums: Array, weight: float, nx: float, ny: float, turn: float, distance: float
) -> None:
    """Add a point to the normal equations: six numbers of the matrix, three of the right side."""
    sums[0] += weight * nx * nx
    sums[1] += weight * nx * ny
    sums[2] += weight * nx * turn
    sums[3] += weight * ny * ny
    sums[4] += weight * ny * turn
    sums[5] += weight * turn * turn
    sums[6] -= weight * nx * distance
    sums[7] -= weight * ny * distance
    sums[8] -= weight * turn * distance


@inner_loop()
def _add_information(
    sums: Array,
    weight: float,
    nx: float,
    ny: float,
    turn: float,
    mx: float,
    my: float,
    mturn: float,
) -> None:
    """Add a point to the information matrix.

    Its normals are from both views, whose errors are independent: those of one view alone would
    claim information about motion along a wall.
    """
    sums[0] += weight * nx * mx
    sums[1] += weight * (nx * my + mx * ny) / 2
    sums[2] += weight * (nx * mturn + mx * turn) / 2
    sums[3] += weight * ny * my
    sums[4] += weight * (ny * mturn + my * turn) / 2
    sums[5] += weight * turn * mturn


@inner_loop()
def _move(pose: Array, sums: Array) -> None:
    """Move a pose by the solution of the normal equations.

    Small diagonal entries keep directions about which nothing is known (Levenberg's damping).
    """
    a01, a02, a12 = sums[1], sums[2], sums[4]
    a00, a11, a22 = sums[0] + 100.0, sums[3] + 100.0, sums[5] + 100.0
    b0, b1, b2 = sums[6], sums[7], sums[8]
    c0, c1, c2 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c4, c5, c8 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    det = a00 * c0 + a01 * c1 + a02 * c2
    pose[0] += (c0 * b0 + c1 * b1 + c2 * b2) / det
    pose[1] += (c1 * b0 + c4 * b1 + c5 * b2) / det
    pose[2] += (c2 * b0 + c5 * b1 + c8 * b2) / det
