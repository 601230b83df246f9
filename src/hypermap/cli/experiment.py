"""`hypermap experiment`: experiments that anyone can repeat."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import AsJson, Force, check_output
from hypermap.cli.progress import counting
from hypermap.cli.simulate import ERRORS, SENSORS, WHAT_ERRS, WHAT_SENSOR, errors_of, world_of
from hypermap.cli.terminal import out, say, say_json, table
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.experiments.drives import Mapped, SimulatedDrive
    from hypermap.experiments.results import Data, WorldResult
    from hypermap.mapping.config import MappingConfig
    from hypermap.simulation import World


def command(
    name: Annotated[str, typer.Argument(metavar="thesis|days", help="Which experiment.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            show_default="thesis.html, days.json",
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
    seeds: Annotated[
        int,
        typer.Option(
            min=1, max=1000, help="Drives through each world; for days, series of drives."
        ),
    ] = 10,
    drives: Annotated[
        int, typer.Option(min=2, max=1000, help="Drives in each series, a day apart: for days.")
    ] = 5,
    first_seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            show_default="1000, or 5000 with worlds of test",
            help="Seed of the first drive. Seeds from 5000 on are only for measurements.",
        ),
    ] = None,
    errors: Annotated[str, typer.Option(metavar=ERRORS, help=WHAT_ERRS)] = "robot",
    sensor: Annotated[str, typer.Option(metavar=SENSORS, help=WHAT_SENSOR)] = "kinect_v1",
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

    days: drives a day apart, each mapped onto the previous map. Between them, objects are moved,
    removed, added and swapped. This prints how many of these changes the map reports, how many of
    the reported ones are real, and how often objects change their ids.

    Examples:
        hypermap experiment thesis
        hypermap experiment thesis --seeds 2 --worlds lab -o quick.html
        hypermap experiment thesis --worlds dev --errors rough --sensor tof --methods default
        hypermap experiment days --worlds lab --seeds 2 --drives 3 --rate 1
    """
    from hypermap.cli.experiment_days import SeriesPlan, run_days
    from hypermap.experiments.drives import SimulatedDrive
    from hypermap.experiments.methods import chosen_methods
    from hypermap.experiments.report import write_report
    from hypermap.experiments.results import made_with, to_data
    from hypermap.experiments.sets import first_seed_of, worlds_named
    from hypermap.simulation import varied
    from hypermap.simulation.network import named_for_network

    if name not in ("thesis", "days"):
        raise HypermapError(f"there is no experiment {name!r}; known: thesis, days")
    if network and name == "days":
        raise HypermapError("--network: only the experiment `thesis` has it")
    words = worlds_named(worlds)
    described = [world_of(word) for word in words]
    if network:
        described = [named_for_network(world) for world in described]
    _check_names([world.name for world in described], words)
    chosen, methods = errors_of(errors, sensor), chosen_methods(wanted)
    first = first_seed_of(words) if first_seed is None else first_seed
    jobs = jobs or len(os.sched_getaffinity(0))
    if name == "days":
        figures = output or Path("days.json")
        check_output(figures, replace)
        plan = SeriesPlan(tuple(described), range(first, first + seeds), chosen, rate, drives)
        run_days(plan, jobs, figures, as_json)
        return
    output = output or Path("thesis.html")
    figures = output.with_suffix(".json")
    for file in (output, figures):
        check_output(file, replace)
    planned = [
        SimulatedDrive(varied(world, seed), seed, chosen, rate, network)
        for world in described
        for seed in range(first, first + seeds)
    ]
    results = _results(_map(planned, methods, jobs), described)
    data = to_data(results)
    data["command"] = _repeating(worlds, seeds, first, errors, sensor, wanted, rate, network)
    data["made_with"] = made_with(chosen, methods)
    write_report(results, data, output, data["command"])
    figures.write_text(json.dumps(data, indent=1), encoding="utf-8")
    if as_json:
        say_json(data)
        return
    for world in data["worlds"]:
        _show(world)
    say(f"\nreport   {output}\nfigures  {figures}")


def _map(
    drives: list[SimulatedDrive], methods: dict[str, MappingConfig], jobs: int
) -> list[Mapped]:
    from hypermap.experiments.drives import map_drives

    mapped = []
    with counting("mapping", len(drives), "drives") as count:
        for done in map_drives(drives, methods, jobs):
            mapped.append(done)
            count()
    return mapped


def _results(mapped: list[Mapped], worlds: list[World]) -> list[WorldResult]:
    """Return the results of all drives, world by world."""
    from hypermap.experiments.results import WorldResult

    return [
        WorldResult.of([each for each in mapped if each.drive.world.name == world.name])
        for world in worlds
    ]


def _repeating(
    worlds: str,
    seeds: int,
    first: int,
    errors: str,
    sensor: str,
    wanted: str,
    rate: float,
    network: bool,
) -> str:
    """Return the command that repeats an experiment."""
    options = f"--worlds {worlds} --seeds {seeds} --first-seed {first} --errors {errors}"
    if sensor != "kinect_v1":
        options += f" --sensor {sensor}"
    if network:
        options += " --network"
    if wanted != "all":
        options += f" --methods {wanted}"
    return f"hypermap experiment thesis {options} --rate {rate:g}"


def _check_names(names: list[str], words: list[str]) -> None:
    """Raise a HypermapError if two worlds have the same name."""
    first: dict[str, str] = {}
    for name, word in zip(names, words, strict=True):
        if name in first:
            raise HypermapError(
                f"--worlds: {first[name]} and {word} have the same name {name!r}; change the key "
                "`name` of one file, or use only one of them"
            )
        first[name] = word


def _show(world: Data) -> None:
    from hypermap.experiments.report import number, probability

    columns = ("IoU", "off by\n[m]", "thesis'\nIoU", "thesis'\n[m]", "p\n(IoU)", "p\n(off by)",
               "objects", "precision", "recall", "F1")  # fmt: skip
    rows = table("method", *columns, right=columns)
    for name, method in world["methods"].items():
        published = method["published"] or {}
        quarter = method["at"][0]
        rows.add_row(
            name,
            number(method["iou"]),
            number(method["distance"]),
            number(published.get("iou")),
            number(published.get("distance")),
            probability(method.get("p_iou")),
            probability(method.get("p_distance")),
            number(method["objects"], 1),
            *(number(quarter[key]) for key in ("precision", "recall", "f1")),
        )
    say(f"\n{world['world']}: {world['objects']} objects, {len(world['seeds'])} drives\n")
    out().print(rows)
    bound = world["bound"]
    say(
        f"found by the detector at all: {bound['detected']:.2f} of the objects, in two frames or "
        f"more {bound['detected_twice']:.2f}, which bounds recall"
    )
    say("p: that the last method is no better; precision, recall and F1 at an IoU of 0.25")
