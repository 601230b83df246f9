"""Models of furniture, each built of a few convex parts.

A model stands on its origin, z up, and looks along +x: a chair's back is at -x. To add one, write a
function like those below and name it in `models`; its keyword arguments are the size parameters [m]
that a world file may set.
"""

from __future__ import annotations

from hypermap.simulation.parts import Part, box, cylinder, turned


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
    inset: float = 0.001,
) -> tuple[Part, ...]:
    """Top and four legs, which stand `inset` within the edge; the wide side lies along y."""
    top = 0.04
    return (
        box((length, width, top), (0, 0, height - top / 2), color),
        *_legs(length - 2 * inset, width - 2 * inset, height - top, 0.06, "#6f5a45"),
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


def bench(
    color: str = "#a9825a", *, length: float = 0.5, width: float = 1.8, height: float = 0.45
) -> tuple[Part, ...]:
    """A seat on two panels."""
    seat, panel = 0.05, 0.06
    return (
        box((length, width, seat), (0, 0, height - seat / 2), color),
        *(
            box(
                (length * 0.8, panel, height - seat),
                (0, side * width * 0.38, (height - seat) / 2),
                "#6d5a48",
            )
            for side in (-1, 1)
        ),
    )


def bin(  # noqa: A001 - named as what it is
    color: str = "#59636b", *, length: float = 0.28, width: float = 0.28, height: float = 0.4
) -> tuple[Part, ...]:
    """A box, a little narrower than its rim."""
    rim = 0.03
    return (
        box((length * 0.85, width * 0.85, height - rim), (0, 0, (height - rim) / 2), color),
        box((length, width, rim), (0, 0, height - rim / 2), "#3f474d"),
    )


def noteboard(
    color: str = "#f4f4f0", *, length: float = 0.35, width: float = 1.0, height: float = 1.75
) -> tuple[Part, ...]:
    """A board on two posts, which stand on a base plate."""
    base, post, board = 0.04, 0.04, height * 0.55
    middle = (height + base) / 2
    return (
        box((length, width, base), (0, 0, base / 2), "#55585c"),
        *(
            box((post, post, height - base), (-0.02, side * width * 0.42, middle), "#777b80")
            for side in (-1, 1)
        ),
        box((0.02, width * 0.96, board), (0.01, 0, height - board / 2), color),
    )


def panel(
    color: str = "#d9c48f", *, length: float = 0.1, width: float = 1.2, height: float = 0.9
) -> tuple[Part, ...]:
    """A flat box with a picture in front, to hang at a wall: a poster, a screen, a map."""
    frame, picture = 0.05, 0.004
    return (
        box((length - picture, width, height), (-picture / 2, 0, height / 2), "#2b2f35"),
        box(
            (picture, width - 2 * frame, height - 2 * frame),
            ((length - picture) / 2, 0, height / 2),
            color,
        ),
    )


def shelf(
    color: str = "#3f5f9a", *, length: float = 0.6, width: float = 2.0, height: float = 2.4
) -> tuple[Part, ...]:
    """Four posts with boards at a tenth, four tenths and seven tenths of the height, and on top."""
    board, post = 0.03, 0.06
    return (
        *_legs(length, width, height - board, post, color),
        *(
            box((length, width, board), (0, 0, share * height - board / 2), "#b08d57")
            for share in (0.1, 0.4, 0.7, 1.0)
        ),
    )


def bed(
    color: str = "#7f8fa6", *, length: float = 2.0, width: float = 1.4, height: float = 0.9
) -> tuple[Part, ...]:
    """A mattress on its frame and a headboard at the back; one lies looking along +x."""
    mattress, head, frame, wood = 0.2, 0.06, 0.3, "#8a6f4f"
    top, board = frame + mattress, height - frame
    return (
        box((length, width, frame), (0, 0, frame / 2), wood),
        box((length - head, width - 0.04, mattress), (head / 2, 0, frame + mattress / 2), color),
        box((head, width, board), ((head - length) / 2, 0, frame + board / 2), wood),
        box((0.4, width * 0.8, 0.1), (0.3 - length / 2, 0, top + 0.05), "#f0efe8"),
    )
