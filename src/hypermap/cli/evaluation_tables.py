"""The tables that `hypermap evaluate` prints."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypermap.cli.terminal import facts, out, say, table
from hypermap.text import printable

if TYPE_CHECKING:
    from hypermap.evaluation.report import Data

_MEASURES = {"iou": "IoU", "distance": "off by [m]"}
_FOUND = {
    "found": "found",
    "missed": "missed",
    "duplicates": "dupli-\ncates",
    "false": "false",
    "precision": "precision",
    "recall": "recall",
    "f1": "F1",
    "panoptic_quality": "PQ",
}


def show(data: Data) -> None:
    """Print a report: the shapes, what was found, the other map, and the rules of it all."""
    name = data["estimate"]["map"]
    say(f"{name} against {data['ground_truth']['map']}, frame {printable(data['frame_id'])}\n")
    _show_shapes(data)
    for k, found in enumerate(data["all"]["found"]):
        say(f"\nfound at an IoU of {found['min_iou']:g} or more\n")
        _show_found(data, k)
    if "against" in data:
        say(f"\nbetter than {data['against']['estimate']['map']}?\n")
        _show_comparison(data)
    say()
    out().print(facts([*data["rules"].items(), ("-", "not defined")]))


def _show_shapes(data: Data) -> None:
    numbers = (
        "true",
        "map",
        "closest\nIoU",
        "closest\noff by\n[m]",
        "matched\nIoU",
        "matched\noff by\n[m]",
        "matched\narea\nerror",
    )

    def cells(score: Data) -> Iterator[str]:
        count, closest, matched = (score[rule] for rule in ("count", "closest", "matched"))
        yield from (str(count["true"]), str(count["estimated"]))
        yield from (_number(closest[key]) for key in ("iou", "distance"))
        yield from (_number(matched[key]) for key in ("iou", "distance"))
        yield "-" if matched["area_error"] is None else f"{matched['area_error']:.0%}"

    _show_scores(data, numbers, cells)


def _show_found(data: Data, k: int) -> None:
    def cells(score: Data) -> Iterator[str]:
        return (_number(score["found"][k][key]) for key in _FOUND)

    _show_scores(data, tuple(_FOUND.values()), cells)
    quality = data["all"]["found"][k]["class_mean_panoptic_quality"]
    say(f"PQ as the mean over the classes: {_number(quality)}")


def _show_scores(
    data: Data, numbers: Sequence[str], cells: Callable[[Data], Iterable[str]]
) -> None:
    """Print a table with a row for each class, and one for all objects."""
    rows = table("class", *numbers, right=numbers)
    for name, score in data["classes"].items():
        rows.add_row(printable(name), *cells(score))
    rows.add_section()
    rows.add_row("all", *cells(data["all"]))
    out().print(rows)


def _show_comparison(data: Data) -> None:
    ours, other = (Path(run["estimate"]["map"]).name for run in (data, data["against"]))
    if ours == other:
        ours, other = "estimate", "other"
    numbers = (printable(ours), printable(other), "pairs", "better", "worse", "p")
    rows = table("measure", *numbers, "test", right=numbers)
    for comparison in data["comparison"]:
        test = comparison["test"]
        rows.add_row(
            f"{comparison['rule']} {_MEASURES[comparison['measure']]}",
            _number(comparison["estimate"], 3),
            _number(comparison["other"], 3),
            *(str(count) for count in (test["pairs"], comparison["better"], comparison["worse"])),
            _p(test["p"]),
            test["method"],
        )
    out().print(rows)


def _number(value: Any, digits: int = 2) -> str:
    """Return shares and lengths with some digits, counts as they are."""
    return (
        f"{value:.{digits}f}" if isinstance(value, float) else "-" if value is None else str(value)
    )


def _p(value: float) -> str:
    return f"{value:.4f}" if value >= 1e-4 else f"{value:.0e}"
