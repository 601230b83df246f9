"""Arguments of the wrong kind, refused where they are given.

A layer in the place of a map, or a map in that of a layer, would end in an AttributeError inside.
"""

from __future__ import annotations

_REMEDIES = {
    "Axes": "render(map, path) saves a picture",
    "Hypermap": "open_map(path) opens one, Hypermap([layer]) makes one of layers",
    "MapObjects": "hypermap.evaluation.objects_in_frame gives those of a map",
    "Note": 'such as Note(shapely.Point(1, 2), "text")',
    "ObjectPicture": "layer.pictures(id) lists those of an object",
    "OccupancyLayer": "map.occupancy() is that of a map",
    "PathSettings": "of a robot: PathSettings(robot_radius=0.3)",
    "Rooms": "rooms_of_map(map) finds those of a map",
    "SemanticLayer": "map.semantic() is that of a map",
    "Zone": 'around objects: Zone("sofa", margin=0.5)',
}


def check_kind(given: object, *kinds: type) -> None:
    """Raise a TypeError if an argument is of none of the kinds that a function takes.

    >>> check_kind(0.3, int)
    Traceback (most recent call last):
    TypeError: expected int, got float
    """
    if not isinstance(given, kinds):
        names = [kind.__name__ for kind in kinds]
        remedies = "".join(f"; {_REMEDIES[name]}" for name in names if name in _REMEDIES)
        raise TypeError(f"expected {' or '.join(names)}, got {type(given).__name__}{remedies}")
