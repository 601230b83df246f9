"""The tables of a comparison of methods: one function for each, from the figures of one world."""

from __future__ import annotations

from hypermap.experiments.methods import OURS
from hypermap.experiments.results import Data
from hypermap.experiments.tables import Cell, Column, Interval, Table


def tables_of(world: Data) -> list[Table]:
    """Return all tables of a world."""
    return [
        methods_table(world),
        class_table(world, "iou"),
        class_table(world, "distance"),
        *[reliability_table(world, name) for name in world["methods"]],
    ]


def methods_table(world: Data) -> Table:
    """Return the table of all methods, in the measures of the thesis and ours."""
    columns = (
        Column("method"),
        Column("IoU", style="bar"),
        Column("off by [m]"),
        Column("thesis' IoU"),
        Column("thesis' [m]"),
        Column(f"{OURS} gains in IoU (95 %)"),
        Column("p (IoU)", style="probability"),
        Column("is nearer by [m] (95 %)"),
        Column("p (off by)", style="probability"),
        Column("objects", 1),
        Column("precision"),
        Column("recall"),
        Column("F1"),
        Column("F1 at 0.5"),
    )
    return Table(
        f"{world['world']}-methods",
        f"{world['world']}: {world['objects']} true objects, means over {len(world['seeds'])} "
        "drives; precision, recall and F1 at an IoU of 0.25",
        columns,
        tuple(_method_row(name, method) for name, method in world["methods"].items()),
        (OURS,),
    )


def _method_row(name: str, method: Data) -> tuple[Cell, ...]:
    quarter, half = method["at"]
    published = method["published"] or {}
    return (
        name,
        method["iou"],
        method["distance"],
        published.get("iou"),
        published.get("distance"),
        _interval(method.get("gain_iou")),
        method.get("p_iou"),
        _interval(method.get("gain_distance")),
        method.get("p_distance"),
        method["objects"],
        *(quarter[key] for key in ("precision", "recall", "f1")),
        half["f1"],
    )


def class_table(world: Data, measure: str) -> Table:
    """Return the table of one of the thesis' measures by class; "iou" or "distance"."""
    methods = world["methods"]
    classes = next(iter(methods.values()))["classes"]
    title = "IoU" if measure == "iou" else "off by [m]"
    return Table(
        f"{world['world']}-class-{measure}",
        f"{world['world']}: {title} by class",
        (Column("class"), *(Column(name) for name in methods)),
        tuple(
            (class_, *(method["classes"][class_][measure] for method in methods.values()))
            for class_ in classes
        ),
    )


def reliability_table(world: Data, name: str) -> Table:
    """Return how often the objects of a method are true, by how sure its maps are of them."""
    bins = world["methods"][name]["reliability"]
    return Table(
        f"{world['world']}-reliability-{slug(name)}",
        f"{world['world']}, {name}: how often objects are true (IoU of 0.25), by their confidence",
        (Column("confidence"), Column("objects"), Column("mean"), Column("true", style="bar")),
        tuple(
            (f"{b['low']:.1f} to {b['high']:.1f}", b["objects"], b["confidence"], b["right"])
            for b in bins
        ),
    )


def slug(name: str) -> str:
    """Return a name that is good for a file.

    >>> slug("best shape, overlap")
    'best-shape-overlap'
    """
    letters = (sign if sign.isalnum() or sign in "_." else " " for sign in name)
    return "-".join("".join(letters).split())


def _interval(effect: Data | None) -> Interval | None:
    if effect is None:
        return None
    return Interval(effect["mean"], effect["low"], effect["high"])
