"""Models of small things, plants and people; `furniture` says how models are built."""

from __future__ import annotations

from hypermap.simulation.parts import Part, box, cylinder, disc, ellipsoid, turned


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
    """A standing person: legs, trunk, arms and head."""
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


def screen(
    color: str = "#22262b", *, length: float = 0.07, width: float = 0.55, height: float = 0.46
) -> tuple[Part, ...]:
    """A flat monitor on a low stand that is no deeper than itself."""
    stand = 0.08
    z = (height + stand) / 2
    return (
        box((length, width * 0.4, stand), (0, 0, stand / 2), color),
        box((length - 0.004, width, height - stand), (-0.002, 0, z), color),
        box((0.004, width - 0.04, height - stand - 0.04), (length / 2 - 0.002, 0, z), "#5b86b5"),
    )


def keyboard(
    color: str = "#2e3136", *, length: float = 0.15, width: float = 0.44, height: float = 0.03
) -> tuple[Part, ...]:
    """A board with its keys."""
    return (
        box((length, width, height * 0.6), (0, 0, height * 0.3), color),
        box((length * 0.85, width * 0.95, height * 0.4), (0, 0, height * 0.8), "#8c9198"),
    )


def mouse(
    color: str = "#3a3d42", *, length: float = 0.11, width: float = 0.065, height: float = 0.038
) -> tuple[Part, ...]:
    """A base and a round back."""
    return (
        box((length, width, height * 0.3), (0, 0, height * 0.15), color),
        ellipsoid((length * 0.45, width * 0.45, height / 2), (0, 0, height / 2), "#6a6e75"),
    )


def fan(color: str = "#e6e9ea", *, width: float = 0.32, height: float = 0.42) -> tuple[Part, ...]:
    """Foot, pole and a round cage."""
    radius = width / 2
    return (
        cylinder(radius * 0.75, 0.03, (0, 0, 0), color),
        cylinder(0.015, height - radius, (-0.03, 0, 0), "#8f9599"),
        disc(radius, 0.08, (0.03, 0, height - radius), color),
        disc(radius * 0.3, 0.02, (0.08, 0, height - radius), "#4a5157"),
    )


def sitter(
    color: str = "#8a4f3d", *, length: float = 0.75, width: float = 0.44, height: float = 0.85
) -> tuple[Part, ...]:
    """A sitting person from the seat up: thighs, trunk, arms and head; the back is at -x."""
    skin, trousers = "#d9a98c", "#3b3f4a"
    head, back, thigh = height * 0.13, 0.26, 0.14
    shoulder, spine = height - 2.2 * head, (back - length) / 2
    skin, trousers = "#d9a98c", "#3b3f4a"
    legs = (length - 0.04, width * 0.4, thigh)
    arm = (0.3, width * 0.14, 0.1)
    return (
        *(box(legs, (0.02, side * width * 0.2, thigh / 2), trousers) for side in (-1, 1)),
        ellipsoid((back / 2, width * 0.36, shoulder * 0.55), (spine, 0, shoulder * 0.55), color),
        *(
            box(arm, (spine + 0.12, side * width * 0.43, shoulder * 0.55), color)
            for side in (-1, 1)
        ),
        ellipsoid((head, head * 0.85, head * 1.2), (spine + 0.02, 0, height - head * 1.2), skin),
    )


def bottle(
    color: str = "#2f6f4a", *, radius: float = 0.04, height: float = 0.28
) -> tuple[Part, ...]:
    """A body, a shoulder and a neck."""
    body, shoulder = height * 0.6, height * 0.2
    return (
        cylinder(radius, body, (0, 0, 0), color),
        turned([(radius, 0.0), (radius * 0.35, shoulder)], (0, 0, body), color),
        cylinder(radius * 0.35, height - body - shoulder, (0, 0, body + shoulder), color),
    )


def carton(
    color: str = "#b98f5a", *, length: float = 0.4, width: float = 0.5, height: float = 0.35
) -> tuple[Part, ...]:
    """A cardboard box with a strip of tape on top."""
    tape = 0.002
    return (
        box((length, width, height - tape), (0, 0, (height - tape) / 2), color),
        box((length, 0.06, tape), (0, 0, height - tape / 2), "#d9c9a0"),
    )
