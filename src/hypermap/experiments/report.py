"""The report of a comparison of methods: one HTML file with tables, plots and maps."""

from __future__ import annotations

import html
import tempfile
from collections.abc import Sequence
from pathlib import Path

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation.maps import map_objects
from hypermap.experiments.methods import OURS
from hypermap.experiments.page import folded, page_of, picture_of, plot_of, wide
from hypermap.experiments.plots import (
    confusion_plot,
    curves_plot,
    groups_plot,
    reliability_plot,
)
from hypermap.experiments.results import Data, WorldResult
from hypermap.experiments.tables import html_of, number
from hypermap.experiments.thesis_tables import (
    GROUPS,
    class_table,
    gains_table,
    group_table,
    intervals_table,
    methods_table,
    poses_table,
    recall_table,
    reliability_table,
)
from hypermap.formats.atomic import write_file
from hypermap.simulation import ground_truth
from hypermap.text import counted
from hypermap.viewer.comparison import render_comparison


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
        _why() if any(_is_of_the_thesis(world) for world in data["worlds"]) else "",
    ]
    for result, world in zip(results, data["worlds"], strict=True):
        parts += _world(result, world, data["localization_limits"])
    write_file(path, page_of("the thesis' experiment", parts))


def _world(result: WorldResult, world: Data, limits: Sequence[float]) -> list[str]:
    seeds, methods = world["seeds"], world["methods"]
    shown = [name for name in (OURS, "best shape, overlap") if name in methods]
    return [
        f"<h2>{html.escape(world['world'])}</h2>",
        f"<p class=note>{counted(world['objects'], 'true object')}, {counted(len(seeds), 'drive')} "
        f"({_seeds(seeds)}) of {counted(world['frames'], 'frame')}.</p>",
        _bound(world),
        wide(html_of(methods_table(world))),
        *([wide(html_of(intervals_table(world)))] if len(seeds) > 1 else []),
        *[wide(html_of(gains_table(world))) for name in methods if name == OURS],
        plot_of(groups_plot(world), "What is found, by size, distance and number of detections"),
        plot_of(curves_plot(world, limits), "How near objects are, and how good their shapes"),
        wide(html_of(recall_table(world))),
        wide(html_of(poses_table(world))),
        wide(html_of(class_table(world, "iou"))),
        wide(html_of(class_table(world, "distance"))),
        *[folded(f"By {GROUPS[kind]}", wide(html_of(group_table(world, kind)))) for kind in GROUPS],
        *[_ours(world) for name in methods if name == OURS],
        *[_picture(result, name) for name in shown],
    ]


def _seeds(seeds: Sequence[int]) -> str:
    return f"seed {seeds[0]}" if len(seeds) == 1 else f"seeds {seeds[0]} to {seeds[-1]}"


def _ours(world: Data) -> str:
    """Return how far confidences and classes of our maps can be trusted."""
    ours = world["methods"][OURS]
    return "".join(
        (
            plot_of(reliability_plot(ours), f"{OURS}: share of true objects over confidence"),
            html_of(reliability_table(world, OURS)),
            f"<p class=note>Expected calibration error: {number(ours['calibration_error'])}.</p>",
            plot_of(confusion_plot(ours), f"{OURS}: what is mapped in the place of true objects"),
        )
    )


def _is_of_the_thesis(world: Data) -> bool:
    return any(method["published"] for method in world["methods"].values())


def _why() -> str:
    return """<p>Why our figures are not those of the thesis: its two recordings were never
published, so worlds made after its maps stand in for the places, and models of errors for its
camera, its localization and its detector. Its first program took the newest shape for the best one
and never bounded what it kept; the rules here are those that it describes. It looked at one drive;
here each figure is a mean over the drives, which differ in all that chance decides.</p>
<p>The occupancy map of each world is known, as that of the thesis' robot was. The profile default
corrects poses by it; the thesis' methods take them as they are.</p>"""


def _bound(world: Data) -> str:
    """Return how many objects the detections show at all, which bounds recall."""
    bound = world["bound"]
    return (
        f"<p class=note>The drives show {bound['shown']:.0%} of the true objects. The detector "
        f"finds {bound['detected']:.0%} of them by their class in at least one frame, "
        f"{bound['detected_twice']:.0%} in at least two: no method can recall more.</p>"
    )


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
        content = file.read_bytes()
    seed = result.mapped[0].drive.seed
    return picture_of(content, "png", f"{method}: the map of seed {seed} over the truth")
