"""`hypermap evaluate`: measure a map against the truth, and against another map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import AsJson, check_output, check_picture, name_of, title_of
from hypermap.cli.terminal import note, say_json
from hypermap.cli.two_maps import ComparisonPicture
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.evaluation import MapObjects


def command(
    estimate: Annotated[
        Path, typer.Argument(metavar="ESTIMATE", show_default=False, help="The map to evaluate.")
    ],
    ground_truth: Annotated[
        Path,
        typer.Argument(metavar="GROUND_TRUTH", show_default=False, help="The ground truth map."),
    ],
    against: Annotated[
        Path | None,
        typer.Option(
            "--against",
            metavar="OTHER",
            show_default=False,
            help="Another map of the same place: is ESTIMATE significantly better?",
        ),
    ] = None,
    exact: Annotated[
        bool,
        typer.Option(
            "--exact", help="With --against: use the exact test for any number of objects."
        ),
    ] = False,
    csv: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Save all metrics: .csv."),
    ] = None,
    picture: ComparisonPicture = None,
    as_json: AsJson = False,
) -> None:
    """Compare the objects of a map with the ground truth.

    Shows the metrics of the 2019 thesis; overlap, distance and area of one-to-one matches; and the
    numbers of found, missed, duplicate and false objects. Undefined values, such as the recall of a
    class that is not in the ground truth, are shown as a dash.

    Examples:
        hypermap evaluate room.hmap truth.hmap
        hypermap evaluate room.hmap truth.hmap --picture room.png --csv room.csv
        hypermap evaluate default.hmap truth.hmap --against thesis.hmap
    """
    from hypermap.cli.evaluation_tables import show
    from hypermap.evaluation import compare, evaluate, map_objects
    from hypermap.evaluation.report import EvaluationRun, csv_text, report
    from hypermap.formats.any_file import open_any
    from hypermap.formats.atomic import write_file
    from hypermap.viewer.comparison import render_comparison

    _check_outputs(csv, picture)
    if exact and against is None:
        raise HypermapError("--exact needs --against, the map to compare with")
    true_map = open_any(ground_truth)
    truth = map_objects(true_map, name_of(ground_truth))
    _note_repairs(truth)

    def measure(path: Path) -> EvaluationRun:
        objects = map_objects(open_any(path), name_of(path), true_map, truth.name)
        _note_repairs(objects)
        _note_strangers(objects, truth)
        return EvaluationRun(objects, evaluate(objects.objects, truth.objects))

    run = measure(estimate)
    other = None if against is None else measure(against)
    tests = () if other is None else compare(run.evaluation, other.evaluation, exact)
    data = report(truth, run, other, tests)
    if as_json:
        say_json(data)
    else:
        show(data)
    if csv is not None:
        write_file(csv, csv_text(data).encode())
        note(f"saved {csv}")
    if picture is not None:
        title = " against ".join(map(title_of, (estimate, ground_truth)))
        render_comparison(true_map, truth, run.objects, run.evaluation, picture, title=title)
        note(f"saved {picture}")


def _check_outputs(csv: Path | None, picture: Path | None) -> None:
    from hypermap.viewer.picture import check_suffix

    if csv is not None:
        if csv.suffix.lower() != ".csv":
            raise HypermapError(f"{csv}: a table of figures is saved as .csv")
        check_output(csv, replace=True)
    if picture is not None:
        check_suffix(picture)
        check_picture(picture)


def _note_repairs(objects: MapObjects) -> None:
    if objects.repaired:
        outlines = counted(objects.repaired, "outline crosses itself", "outlines cross themselves")
        note(f"{objects.name}: {outlines}; what is wound around counts as inside")


def _note_strangers(objects: MapObjects, truth: MapObjects) -> None:
    """Say it if there is nothing to compare: that is an answer, but seldom the expected one."""
    names = {thing.name for thing in objects.objects}
    if not names:
        note(f"{objects.name}: the map has no objects; nothing was found")
    elif not names & {thing.name for thing in truth.objects}:
        note(
            f"{objects.name}: the map and {truth.name} have no class in common; do they use the "
            "same names?"
        )
    elif (apart := _apart(objects, truth)) > 0:
        note(
            f"{objects.name}: none of its objects lies on one of {truth.name}, whatever their "
            f"names; the nearest are {apart:.2g} m apart; are both in one frame, in meters?"
        )


def _apart(objects: MapObjects, truth: MapObjects) -> float:
    """Return how near the objects of two maps come to each other [m], 0 where they overlap."""
    import shapely

    tree = shapely.STRtree([thing.footprint for thing in truth.objects])
    shapes = [thing.footprint for thing in objects.objects]
    _, distances = tree.query_nearest(shapes, return_distance=True, all_matches=False)
    return float(distances.min())
