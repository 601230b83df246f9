"""The report of an experiment: one HTML file with tables, plots and maps."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation.maps import map_objects
from hypermap.experiments.methods import OURS
from hypermap.experiments.results import Data, WorldResult
from hypermap.formats.atomic import write_file
from hypermap.simulation import ground_truth
from hypermap.viewer.comparison import render_comparison

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em;
       color: #1d2129; }
h1, h2 { font-weight: 650; } h2 { margin-top: 2.5em; border-bottom: 1px solid #ccd; }
table { border-collapse: collapse; margin: 1em 0; font-variant-numeric: tabular-nums; }
th, td { padding: .25em .8em; text-align: right; }
th:first-child, td:first-child { text-align: left; }
td { white-space: nowrap; }
thead th { border-bottom: 2px solid #556; vertical-align: bottom; }
tbody tr:nth-child(even) { background: #f3f5f8; }
tr.ours td { font-weight: 650; }
.bar { display: inline-block; height: .8em; background: #3573b9; vertical-align: middle;
       margin-right: .5em; }
.note { color: #556; } img { max-width: 100%; }
figure { margin: 1em 0; } figcaption { color: #556; }
@media (prefers-color-scheme: dark) { body { background: #16181d; color: #dde1e8; }
  tbody tr:nth-child(even) { background: #20242c; } .note, figcaption { color: #9aa4b2; } }
"""


def write_report(results: Sequence[WorldResult], data: Data, path: Path, command: str) -> None:
    """Write the report; it needs no other file and no network.

    Args:
        results: of all worlds.
        data: their figures, as `to_data` gives them.
        path: where to save.
        command: what makes it, for those who want to repeat it.
    """
    parts = [
        "<h1>The thesis' experiment, repeated in simulation</h1>",
        f"<p>Made by <code>{html.escape(command)}</code>. IoU is the Jaccard index. "
        f"{html.escape(data['rule'])}. A class that a map does not have is left out of its means; "
        "precision and recall count it.</p>",
        _why(),
    ]
    for result, world in zip(results, data["worlds"], strict=True):
        parts.append(f"<h2>{html.escape(world['world'])}</h2>")
        seeds = world["seeds"]
        parts.append(
            f"<p class=note>{world['objects']} true objects, {len(seeds)} drives (seeds {seeds[0]} "
            f"to {seeds[-1]}) of {world['frames']} frames.</p>"
        )
        parts += [
            _bound(world),
            _overall(world),
            _by_class(world, "iou"),
            _by_class(world, "distance"),
        ]
        parts += [_reliability(world["methods"][OURS])] if OURS in world["methods"] else []
        shown = [name for name in (OURS, "best shape, overlap") if name in world["methods"]]
        parts += [_picture(result, name) for name in shown]
    page = (
        "<!doctype html><html lang=en><meta charset=utf-8><title>Hypermap: the thesis' experiment"
        f"</title><style>{_STYLE}</style><body>{''.join(parts)}</body></html>"
    )
    write_file(path, page.encode())


def _why() -> str:
    return """<p>Why our figures are not those of the thesis: its two recordings were never
published, so worlds made after its maps stand in for the places, and models of errors for its
camera, its localization and its detector. Its first program took the newest shape for the best one
and never bounded what it kept; the rules here are those that it describes. It looked at one drive;
here each figure is a mean over several, which differ in all that chance decides.</p>
<p>The occupancy map of each world is known, as that of the thesis' robot was. The profile default
corrects poses by it; the thesis' methods take them as they are.</p>"""


def _overall(world: Data) -> str:
    head = (
        "method", "IoU", "off by [m]", "thesis' IoU", "thesis' [m]",
        f"{OURS} gains in IoU (95 %)", "p", "is nearer by [m] (95 %)", "p",
        "objects", "precision", "recall", "F1 at 0.25", "F1 at 0.5",
    )  # fmt: skip
    rows = []
    for name, method in world["methods"].items():
        quarter, half = method["at"]
        published = method["published"] or {}
        cells = [
            html.escape(name),
            _bar(method["iou"]),
            number(method["distance"]),
            number(published.get("iou")),
            number(published.get("distance")),
            _gain(method.get("gain_iou")),
            probability(method.get("p_iou")),
            _gain(method.get("gain_distance")),
            probability(method.get("p_distance")),
            number(method["objects"], 1),
            *(number(quarter[key]) for key in ("precision", "recall", "f1")),
            number(half["f1"]),
        ]
        rows.append((cells, name == OURS))
    return _table(head, rows)


def _bound(world: Data) -> str:
    """Return how many objects the detections show at all, which bounds recall."""
    bound = world["bound"]
    return (
        f"<p class=note>The drives show {bound['shown']:.0%} of the true objects. The detector "
        f"finds {bound['detected']:.0%} of them by their class in at least one frame, "
        f"{bound['detected_twice']:.0%} in at least two: no method can recall more.</p>"
    )


def _by_class(world: Data, measure: str) -> str:
    names = list(world["methods"])
    title = "IoU by class" if measure == "iou" else "off by [m], by class"
    rows = [
        (
            [
                html.escape(class_),
                *(number(world["methods"][name]["classes"][class_][measure]) for name in names),
            ],
            False,
        )
        for class_ in world["methods"][names[0]]["classes"]
    ]
    return _table((title, *names), rows)


def _reliability(method: Data) -> str:
    """Return how often objects are true, by how sure the map is of them."""
    head = (f"confidence of {OURS}", "objects", "mean confidence", "true, at an IoU of 0.25")
    rows = [
        (
            [
                f"{one['low']:.1f} to {one['high']:.1f}",
                str(one["objects"]),
                number(one["confidence"]),
                _bar(one["right"]),
            ],
            False,
        )
        for one in method["reliability"]
    ]
    error = number(method["calibration_error"])
    return f"{_table(head, rows)}<p class=note>Expected calibration error: {error}.</p>"


def _picture(result: WorldResult, method: str) -> str:
    """Return the first drive's map over the truth."""
    truth_map = ground_truth(result.world)
    layer = SemanticLayer("semantic", truth_map.base_frame, result.mapped[0].objects[method])
    truth = map_objects(truth_map, "truth")
    estimate = map_objects(Hypermap([layer]), method, truth_map, "truth")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "map.png"
        evaluation = result.evaluations[method][0]
        title = f"{result.world.name}: {method}"
        render_comparison(truth_map, truth, estimate, evaluation, file, title=title, size=1100)
        content = base64.b64encode(file.read_bytes()).decode()
    caption = f"{method}: the map of seed {result.mapped[0].drive.seed} over the truth"
    return (
        f'<figure><img alt="{html.escape(caption)}" src="data:image/png;base64,{content}">'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _table(head: Iterable[str], rows: Iterable[tuple[list[str], bool]]) -> str:
    columns = "".join(f"<th>{html.escape(name)}</th>" for name in head)
    body = "".join(
        f"<tr{' class=ours' if is_ours else ''}>"
        + "".join(f"<td>{cell}</td>" for cell in cells)
        + "</tr>"
        for cells, is_ours in rows
    )
    return f"<table><thead><tr>{columns}</tr></thead><tbody>{body}</tbody></table>"


def _gain(effect: Data | None) -> str:
    """Return a mean gain with its interval as text; a dash where there is none."""
    if effect is None:
        return number(None)
    return f"{effect['mean']:.2f} ({effect['low']:.2f} to {effect['high']:.2f})"


def _bar(share: float | None) -> str:
    width = 0 if share is None else 6 * share
    return f'<span class=bar style="width:{width:.2f}em"></span>{number(share)}'


def number(value: float | None, digits: int = 2) -> str:
    """Return a figure as text; a dash where it is not defined."""
    return "-" if value is None else f"{value:.{digits}f}"


def probability(p: float | None) -> str:
    """Return a probability as text; a dash where it is not defined."""
    if p is None:
        return "-"
    return f"{p:.3f}" if p >= 0.001 else f"{p:.0e}"
