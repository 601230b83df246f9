"""Models of furniture and other things, each built of a few convex parts.

A model stands on its origin, z up, and looks along +x: a chair's back is at -x, a monitor's
screen at +x. To add one, write a function like those below; its keyword arguments are the size
parameters [m] that a world file may set.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import ImageColor
from trimesh import Trimesh, creation

from hypermap.core.errors import did_you_mean

MAX_SIZE = 20.0  # metres
_SECTIONS = 24  # sides of a round part


@dataclass(frozen=True, eq=False)
class Part:
    """A convex body of one color.

    Attributes:
        vertices: metres, shape (V, 3).
        faces: rows of `vertices`, counter-clockwise seen from outside, shape (F, 3).
        color: RGB, 0..1, shape (3,).
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    color: NDArray[np.float64]


Model = Callable[..., tuple[Part, ...]]


def build(model: str, size: Mapping[str, float], color: str | None) -> tuple[Part, ...]:
    """Return the parts of a model at its origin.

    Args:
        model: a key of `MODELS`.
        size: the model's size parameters [m] that differ from its defaults.
        color: of its main parts, as "#b5835a" or "teal"; None for the model's own.

    Raises:
        ValueError: If the model, a parameter or the color is unknown, or a size is out of range.
    """
    if model not in MODELS:
        raise ValueError(f"unknown model {model!r}; {did_you_mean(model, MODELS)}")
    known = size_parameters(model)
    for key, value in size.items():
        if key not in known:
            raise ValueError(f"{model} has no size {key!r}; {did_you_mean(key, known)}")
        if not 0 < value <= MAX_SIZE:
            raise ValueError(f"{key} must lie above 0 and at most at {MAX_SIZE:g} m, got {value}")
    return MODELS[model](*(() if color is None else (color,)), **size)


def size_parameters(model: str) -> dict[str, float]:
    """Return the size parameters of a model and their defaults [m]."""
    parameters = inspect.signature(MODELS[model]).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


def rgb(color: str) -> NDArray[np.float64]:
    """Return a color such as "#b5835a" or "teal" as numbers from 0 to 1, shape (3,)."""
    try:
        return np.array(ImageColor.getrgb(color)[:3]) / 255
    except ValueError:
        raise ValueError(f"{color!r} is no color; write it as '#b5835a' or 'teal'") from None


def box(size: Sequence[float], center: Sequence[float], color: str) -> Part:
    """Return a box with its sides along the axes.

    Raises:
        ValueError: If a side is not positive, as when a seat lies above the chair's back.
    """
    if min(size) <= 0:
        raise ValueError("these sizes do not fit together: a part would have no extent")
    return _part(creation.box(extents=size), center, color)


def turned(profile: Sequence[tuple[float, float]], center: Sequence[float], color: str) -> Part:
    """Return a round body: a convex profile of (radius, z), from bottom to top, turned about z."""
    closed = [(0.0, profile[0][1]), *profile, (0.0, profile[-1][1])]
    return _part(creation.revolve(np.array(closed), sections=_SECTIONS), center, color)


def cylinder(radius: float, height: float, base: Sequence[float], color: str) -> Part:
    """Return an upright cylinder that stands on `base`."""
    return turned([(radius, 0.0), (radius, height)], base, color)


def ellipsoid(radii: Sequence[float], center: Sequence[float], color: str) -> Part:
    """Return an ellipsoid with its axes along x, y and z."""
    mesh = creation.icosphere(subdivisions=3)
    mesh.apply_scale(radii)
    return _part(mesh, center, color)


def _part(mesh: Trimesh, center: Sequence[float], color: str) -> Part:
    vertices = np.asarray(mesh.vertices, dtype=np.float64) + np.asarray(center)
    return Part(vertices, np.asarray(mesh.faces, dtype=np.int64), rgb(color))


def _legs(length: float, width: float, height: float, thickness: float, color: str) -> list[Part]:
    """Return four legs whose outer sides stand at +-length / 2 and +-width / 2."""
    dx, dy = (length - thickness) / 2, (width - thickness) / 2
    return [
        box((thickness, thickness, height), (x, y, height / 2), color)
        for x in (-dx, dx)
        for y in (-dy, dy)
    ]


def chair(
    color: str = "#9c6b3c",
    *,
    length: float = 0.45,
    width: float = 0.45,
    height: float = 0.88,
    seat_height: float = 0.45,
) -> tuple[Part, ...]:
    """Seat, back and four legs."""
    seat, back = 0.04, 0.04
    back_height = height - seat_height
    return (
        box((length, width, seat), (0, 0, seat_height - seat / 2), color),
        box(
            (back, width, back_height),
            ((back - length) / 2, 0, seat_height + back_height / 2),
            color,
        ),
        *_legs(length, width, seat_height - seat, 0.04, color),
    )


def table(
    color: str = "#c49a6c",
    *,
    length: float = 0.8,
    width: float = 1.4,
    height: float = 0.74,
) -> tuple[Part, ...]:
    """Top and four legs; the wide side lies along y."""
    top = 0.04
    return (
        box((length, width, top), (0, 0, height - top / 2), color),
        *_legs(length, width, height - top, 0.06, "#6f5a45"),
    )


def cup(color: str = "#d6453d", *, radius: float = 0.045, height: float = 0.11) -> tuple[Part, ...]:
    """A mug with its handle to the right (-y)."""
    grip = radius * 0.7
    return (
        turned([(radius * 0.8, 0.0), (radius, height)], (0, 0, 0), color),
        box((0.015, grip, height * 0.6), (0, -radius - grip / 2 + 0.01, height / 2), color),
    )


def monitor(
    color: str = "#22262b",
    *,
    width: float = 0.56,
    height: float = 0.48,
    depth: float = 0.2,
) -> tuple[Part, ...]:
    """Foot, stand, and the screen with its bright picture."""
    screen = height * 0.72
    z = height - screen / 2
    return (
        box((depth, width * 0.45, 0.02), (0, 0, 0.01), color),
        box((0.04, 0.06, z), (-0.02, 0, z / 2), color),
        box((0.04, width, screen), (0.01, 0, z), color),
        box((0.002, width - 0.04, screen - 0.04), (0.031, 0, z), "#5b86b5"),
    )


def person(
    color: str = "#3f6f9f", *, height: float = 1.75, width: float = 0.46
) -> tuple[Part, ...]:
    """Somebody who stands: legs, trunk, arms and head."""
    hip, shoulder, head = height * 0.48, height * 0.83, height * 0.075
    trunk, arm = width * 0.34, width * 0.09
    skin, trousers = "#d9a98c", "#3b3f4a"
    trunk_height, arm_height = shoulder - hip, shoulder - hip * 0.95
    return (
        *(cylinder(width * 0.16, hip, (0, side * trunk / 2, 0), trousers) for side in (-1, 1)),
        *(box((0.26, 0.1, 0.07), (0.05, side * trunk / 2, 0.035), "#222222") for side in (-1, 1)),
        ellipsoid((width * 0.28, trunk, trunk_height * 0.62), (0, 0, (hip + shoulder) / 2), color),
        *(
            cylinder(arm, arm_height, (0, side * (width / 2 - arm), hip * 0.95), color)
            for side in (-1, 1)
        ),
        cylinder(0.055, height * 0.06, (0, 0, shoulder), skin),
        ellipsoid((head * 1.1, head, head * 1.3), (0.01, 0, height - head * 1.3), skin),
    )


def plant(color: str = "#3f7d3a", *, radius: float = 0.3, height: float = 1.1) -> tuple[Part, ...]:
    """A pot with a stem and three bunches of leaves."""
    pot = height * 0.3
    bunches = [(0.25, 0.1, 0.55, 0.75), (-0.2, 0.25, 0.68, 0.72), (-0.05, -0.25, 0.8, 0.72)]
    shades = [color, "#4d8f46", "#356b33"]
    return (
        turned([(radius * 0.45, 0.0), (radius * 0.62, pot)], (0, 0, 0), "#b4643c"),
        cylinder(0.025, height * 0.75, (0, 0, 0), "#5d4a33"),
        *(
            ellipsoid(
                (radius * share, radius * share, height * 0.2),
                (radius * x, radius * y, height * z),
                shade,
            )
            for (x, y, z, share), shade in zip(bunches, shades, strict=True)
        ),
    )


def sofa(
    color: str = "#7d8a6b",
    *,
    length: float = 0.9,
    width: float = 1.9,
    height: float = 0.8,
    seat_height: float = 0.42,
) -> tuple[Part, ...]:
    """Base, back, two arms and two cushions; one sits looking along +x."""
    back, arm, cushion = length * 0.25, 0.18, 0.12
    arm_height = (seat_height + height) / 2
    seat, place = length - back, (width - 2 * arm) / 2
    return (
        box((length, width, seat_height - cushion), (0, 0, (seat_height - cushion) / 2), color),
        box((back, width, height), ((back - length) / 2, 0, height / 2), color),
        *(
            box((length, arm, arm_height), (0, side * (width - arm) / 2, arm_height / 2), color)
            for side in (-1, 1)
        ),
        *(
            box(
                (seat, place - 0.01, cushion),
                (back / 2, side * place / 2, seat_height - cushion / 2),
                "#94a082",
            )
            for side in (-1, 1)
        ),
    )


def sink(
    color: str = "#e8e8e4",
    *,
    length: float = 0.6,
    width: float = 0.8,
    height: float = 0.88,
) -> tuple[Part, ...]:
    """A cabinet, the basin's rim around its bottom, and a tap at the back."""
    rim, basin, steel = 0.1, 0.16, "#aeb4b8"
    cabinet = height - basin
    sides = (width - rim) / 2
    ends = (length - rim) / 2
    return (
        box((length, width, cabinet), (0, 0, cabinet / 2), color),
        *(
            box((length, rim, basin), (0, side * sides, height - basin / 2), steel)
            for side in (-1, 1)
        ),
        *(
            box((rim, width - 2 * rim, basin), (side * ends, 0, height - basin / 2), steel)
            for side in (-1, 1)
        ),
        cylinder(0.02, 0.25, (-ends, 0, height), "#8d9397"),
        box((length * 0.4, 0.03, 0.03), (length * 0.2 - ends, 0, height + 0.24), "#8d9397"),
    )


def cupboard(
    color: str = "#d8c7a3",
    *,
    length: float = 0.45,
    width: float = 1.0,
    height: float = 1.8,
) -> tuple[Part, ...]:
    """A body, two doors and their handles."""
    door, gap = 0.02, 0.01
    front = length / 2
    leaf = width / 2 - gap
    return (
        box((length - door, width, height), (-door / 2, 0, height / 2), "#8f7f5f"),
        *(
            box((door, leaf, height - 0.1), (front - door / 2, side * width / 4, height / 2), color)
            for side in (-1, 1)
        ),
        *(
            box((0.02, 0.02, 0.15), (front + 0.01, side * 0.06, height / 2), "#4a4a4a")
            for side in (-1, 1)
        ),
    )


def lamp(color: str = "#f2dfae", *, radius: float = 0.22, height: float = 1.6) -> tuple[Part, ...]:
    """A standing lamp: foot, pole and shade."""
    shade, metal = height * 0.2, "#3d3d40"
    return (
        cylinder(radius * 0.7, 0.03, (0, 0, 0), metal),
        cylinder(0.018, height - shade / 2, (0, 0, 0), metal),
        turned([(radius, 0.0), (radius * 0.65, shade)], (0, 0, height - shade), color),
    )


MODELS: Mapping[str, Model] = {
    model.__name__: model
    for model in (chair, table, cup, monitor, person, plant, sofa, sink, cupboard, lamp)
}
