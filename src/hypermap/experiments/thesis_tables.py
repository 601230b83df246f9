"""The tables of a comparison of methods: one function for each, from the figures of one world."""

from __future__ import annotations

from hypermap.experiments.methods import OURS
from hypermap.experiments.results import MEASURES, Data
from hypermap.experiments.tables import Cell, Column, Interval, Table
from hypermap.text import counted

NOTHING = "(nothing)"
NOT_MAPPED = "(not mapped)"


def tables_of(world: Data) -> list[Table]:
    """Return all tables of a world."""
    return [
        methods_table(world),
        *([intervals_table(world)] if len(world["seeds"]) > 1 else []),
        *([gains_table(world)] if OURS in world["methods"] else []),
        class_table(world, "iou"),
        class_table(world, "distance"),
        recall_table(world),
        poses_table(world),
        *[group_table(world, kind) for kind in GROUPS],
        *[reliability_table(world, name) for name in world["methods"]],
        *[confusion_table(world, name) for name in world["methods"]],
    ]


def methods_table(world: Data) -> Table:
    """Return the table of all methods, in the measures of the thesis and ours.

    The thesis' own figures are next to ours in the worlds that it has.
    """
    has_any = any(method["published"] for method in world["methods"].values())
    return Table(
        f"{world['world']}-methods",
        f"{world['world']}: {counted(world['objects'], 'true object')}, means over "
        f"{counted(len(world['seeds']), 'drive')}; precision, recall and F1 at an IoU of 0.25",
        (
            Column("method"),
            Column("IoU", style="bar"),
            Column("off by [m]"),
            *([Column("thesis' IoU"), Column("thesis' [m]")] if has_any else []),
            Column("objects", 1),
            Column("precision"),
            Column("recall"),
            Column("F1"),
            Column("F1 at 0.5"),
        ),
        tuple(_method_row(name, method, has_any) for name, method in world["methods"].items()),
        (OURS,),
    )


def _method_row(name: str, method: Data, has_published: bool) -> tuple[Cell, ...]:
    quarter, half = method["at"]
    published = method["published"] or {}
    return (
        name,
        method["iou"],
        method["distance"],
        *((published.get("iou"), published.get("distance")) if has_published else ()),
        method["objects"],
        *(quarter[key] for key in ("precision", "recall", "f1")),
        half["f1"],
    )


def intervals_table(world: Data) -> Table:
    """Return the means of all methods over the drives, and how sure these are."""
    return Table(
        f"{world['world']}-intervals",
        f"{world['world']}: means over {counted(len(world['seeds']), 'drive')}, with their 95 % "
        "intervals (Student's t, over the drives)",
        (Column("method"), *(Column(measure.title) for measure in MEASURES.values())),
        tuple(
            (name, *(found and Interval(**found, is_change=False) for found in intervals.values()))
            for name, method in world["methods"].items()
            for intervals in [method["intervals"]]
        ),
        (OURS,),
    )


def gains_table(world: Data) -> Table:
    """Return by how much our method is better than each other one, and how sure that is."""
    return Table(
        f"{world['world']}-gains",
        f"{world['world']}: by how much {OURS} is better, paired by true object: mean gain with "
        "its 95 % interval (Student's t), matched-pairs rank-biserial correlation r, and p of a "
        "one-sided Wilcoxon signed-rank test that it is no better",
        (
            Column("method"),
            Column("pairs"),
            Column("gain in IoU"),
            Column("r (IoU)"),
            Column("p (IoU)", style="probability"),
            Column("nearer by [m]"),
            Column("r (nearer)"),
            Column("p (nearer)", style="probability"),
        ),
        tuple(
            (name, (method["gain_iou"] or {}).get("pairs", 0), *_gain(method, "iou"),
             *_gain(method, "distance"))
            for name, method in world["methods"].items()
            if "gain_iou" in method
        ),
    )  # fmt: skip


def _gain(method: Data, measure: str) -> tuple[Cell, Cell, Cell]:
    effect, p = method[f"gain_{measure}"], method[f"p_{measure}"]
    if effect is None:
        return None, None, None
    return Interval(effect["mean"], effect["low"], effect["high"]), effect["rank_biserial"], p


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


def recall_table(world: Data) -> Table:
    """Return the recall of what a method could find, and its average precision."""
    return Table(
        f"{world['world']}-recall",
        f"{world['world']}: recall (IoU of 0.25) of all objects, of those that a drive shows, and "
        "of those that the detector finds in one or two frames; average precision",
        (
            Column("method"),
            Column("recall"),
            Column("of seen"),
            Column("of detected"),
            Column("of detected twice"),
            Column("AP at 0.25"),
            Column("AP at 0.5"),
            Column("AP at 0.75"),
        ),
        tuple(
            (
                name,
                method["at"][0]["recall"],
                method["recall_of_seen"],
                method["recall_of_detected"],
                method["recall_of_detected_twice"],
                *(method["average_precision"][at] for at in ("0.25", "0.50", "0.75")),
            )
            for name, method in world["methods"].items()
        ),
        (OURS,),
    )


def poses_table(world: Data) -> Table:
    """Return the errors of the poses that methods are given, and of those that they map from."""
    figures = (("ate", "ATE [m]", 3), ("ate_deg", "ATE [deg]", 2), ("rpe", "RPE [m]", 3),
               ("rpe_deg", "RPE [deg]", 2))  # fmt: skip
    return Table(
        f"{world['world']}-poses",
        f"{world['world']}: errors of the poses as given, and after the method's correction: "
        "absolute (ATE), and relative over 1 s (RPE); root mean squares, means over the drives",
        (
            Column("method"),
            *(
                Column(f"{title} {when}", digits)
                for _, title, digits in figures
                for when in ("given", "corrected")
            ),
        ),
        tuple(
            (
                name,
                *(
                    method["poses"][when][key]
                    for key, _, _ in figures
                    for when in ("given", "used")
                ),
            )
            for name, method in world["methods"].items()
            if method["poses"] is not None
        ),
        (OURS,),
    )


GROUPS = {
    "class": "class",
    "size": "area of the footprint [m²]",
    "distance": "nearest view [m]",
    "views": "number of frames with a detection",
    "object": "object",
}


def group_table(world: Data, kind: str) -> Table:
    """Return what becomes of groups of true objects, a row for each method and group."""
    title = GROUPS[kind]
    return Table(
        f"{world['world']}-by-{kind}",
        f"{world['world']}: true objects of all drives, by {title}",
        (
            Column(title),
            Column("method"),
            Column("objects"),
            Column("IoU"),
            Column("off by [m]"),
            Column("recall"),
            Column("recall at 0.5"),
        ),
        tuple(
            (group["words"], name, *(value for key, value in group.items() if key != "words"))
            for groups in zip(*_groups(world, kind), strict=True)
            for name, group in zip(world["methods"], groups, strict=True)
        ),
    )


def _groups(world: Data, kind: str) -> list[list[Data]]:
    return [method["groups"][kind] for method in world["methods"].values()]


def confusion_table(world: Data, name: str) -> Table:
    """Return how often each class is mapped as each; rows are true classes."""
    confusion = world["methods"][name]["confusion"]
    classes = confusion["classes"]
    return Table(
        f"{world['world']}-confusion-{name}",
        f"{world['world']}, {name}: true classes (rows) and mapped classes (columns) of objects in "
        "one place (IoU of 0.25), over all drives",
        (Column("true"), *(Column(class_) for class_ in classes), Column(NOT_MAPPED)),
        tuple(
            (class_, *row)
            for class_, row in zip((*classes, NOTHING), confusion["counts"], strict=True)
        ),
    )


def reliability_table(world: Data, name: str) -> Table:
    """Return how often the objects of a method are true, by how sure its maps are of them."""
    bins = world["methods"][name]["reliability"]
    return Table(
        f"{world['world']}-reliability-{name}",
        f"{world['world']}, {name}: how often objects are true (IoU of 0.25), by their confidence",
        (Column("confidence"), Column("objects"), Column("mean"), Column("true", style="bar")),
        tuple(
            (f"{b['low']:.1f} to {b['high']:.1f}", b["objects"], b["confidence"], b["right"])
            for b in bins
        ),
    )
