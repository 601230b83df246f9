"""`hypermap experiment`: experiments that anyone can repeat."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from hypermap.cli.experiment_plan import DRIVES, Plan
from hypermap.cli.options import AsJson, Force
from hypermap.cli.simulate import ErrorLevel, SensorName
from hypermap.core.errors import HypermapError, did_you_mean

_EXPERIMENTS = {
    "thesis": "hypermap.cli.experiment_thesis",
    "ablation": "hypermap.cli.experiment_ablation",
    "days": "hypermap.cli.experiment_days",
}


class _ListsMethods(TyperCommand):
    """Its help lists the methods that are installed, which takes a look into all packages."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from hypermap.experiments.installed_methods import installed_names

        self.epilog = f"Installed methods: {', '.join(installed_names()) or 'none'}."
        super().format_help(ctx, formatter)


COMMAND_CLASS = _ListsMethods


def command(
    name: Annotated[str, typer.Argument(metavar="thesis|ablation|days", help="Which experiment.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default="thesis.html, ablation.html, days.json",
            help="Save here: a report, .html; for days, all figures, .json.",
        ),
    ] = None,
    worlds: Annotated[
        str,
        typer.Option(
            metavar="dev|test|WORLD,...",
            help="Worlds of `hypermap simulate`, or files. dev: those for development and tuning; "
            "test: those only for measurements.",
        ),
    ] = "lab,floor",
    wanted: Annotated[
        str,
        typer.Option(
            "--methods",
            metavar="all|NAME,...",
            help="Methods by the first letters of their names: default, best, convex, ...",
        ),
    ] = "all",
    added: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            metavar="FILE|NAME",
            show_default=False,
            help="Another method: a YAML file as for `hypermap map --config`, or the name of an "
            "installed one (below). May be repeated. For ablation: instead of the profile default.",
        ),
    ] = None,
    exact: Annotated[
        bool,
        typer.Option(
            "--pcl",
            help="Cut objects out exactly as PCL does for the methods of the thesis. Takes 0.5 s "
            "per frame, and not 0.01 s.",
        ),
    ] = False,
    parts: Annotated[
        str,
        typer.Option(
            metavar="all|NAME,...",
            help="For ablation: leave out only these parts, by the first letters of their names.",
        ),
    ] = "all",
    seeds: Annotated[
        int,
        typer.Option(
            min=1, max=1000, help="Drives through each world; for days, series of drives."
        ),
    ] = 10,
    drives: Annotated[
        int, typer.Option(min=2, max=1000, help="Drives in each series, a day apart: for days.")
    ] = DRIVES,
    first_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            show_default="1000, or 5000 with worlds of test",
            help="Seed of the first drive. Seeds from 5000 on are only for measurements.",
        ),
    ] = None,
    errors: ErrorLevel = "robot",
    sensor: SensorName = "kinect_v1",
    network: Annotated[
        bool,
        typer.Option(
            "--network",
            help="Detect with the network of `hypermap demo`, which sees only the images, and has "
            "class names of its own, and not with errors added to the truth.",
        ),
    ] = False,
    rate: Annotated[float, typer.Option(min=0.1, max=30, help="Frames per second.")] = 2.0,
    jobs: Annotated[
        int, typer.Option(min=0, max=256, help="Number of parallel drives; 0: one per core.")
    ] = 0,
    as_json: AsJson = False,
    replace: Force = False,
) -> None:
    """Repeat the experiment of the 2019 thesis in simulation, with its four methods and ours.

    Every method maps the same drives through a laboratory and a floor like those of the thesis,
    with different random errors; in most other worlds each seed also moves and resizes the
    furniture. The occupancy map is known. The profile `default` corrects poses by it; the methods
    of the thesis do not. The tables have the form of the thesis. A JSON file next to the report
    contains all values.

    ablation: our method without each of its parts in turn, on the same drives, and how much worse
    each drive gets.

    days: drives a day apart, each mapped onto the previous map. Between them, objects are moved,
    removed, added and swapped. This prints how many of these changes the map reports, how many of
    the reported ones are real, and how often objects change their ids.

    Examples:
        hypermap experiment thesis
        hypermap experiment thesis --seeds 2 --worlds lab -o quick.html
        hypermap experiment thesis --worlds dev --errors rough --sensor tof --methods default
        hypermap experiment thesis --worlds lab --methods default --method mine.yaml
        hypermap experiment thesis --worlds lab --pcl
        hypermap experiment ablation --worlds lab --seeds 4
        hypermap experiment days --worlds lab --seeds 2 --drives 3 --rate 1
    """
    if name not in _EXPERIMENTS:
        hint = did_you_mean(name, _EXPERIMENTS)
        raise HypermapError(f"there is no experiment {name!r}; {hint}")
    plan = Plan(
        name=name,
        worlds=worlds,
        methods=wanted,
        added=tuple(added or ()),
        exact=exact,
        parts=parts,
        seeds=seeds,
        drives=drives,
        given_first_seed=first_seed,
        level=errors,
        sensor=sensor,
        network=network,
        rate=rate,
        given_jobs=jobs,
    )
    plan.check_options()
    importlib.import_module(_EXPERIMENTS[name]).run(plan, output, as_json, replace)
