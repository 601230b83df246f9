"""`hypermap experiment thesis`: methods compared on the same drives."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.experiment_plan import Plan
from hypermap.cli.experiment_tables import check_outputs, show, tables_folder
from hypermap.cli.terminal import say, say_json
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.experiments.results import Data


def run(plan: Plan, output: Path | None, as_json: bool, replace: bool) -> None:
    """Map all drives by all methods, show what came of them, and save it."""
    from hypermap.experiments.figures import made_with, to_data
    from hypermap.experiments.methods import chosen_methods
    from hypermap.experiments.report import write_report
    from hypermap.experiments.results import failures
    from hypermap.experiments.tables import save_tables
    from hypermap.experiments.thesis_tables import tables_of
    from hypermap.formats.atomic import write_file

    output = output or Path("thesis.html")
    methods = chosen_methods(plan.methods, plan.added, plan.exact)
    made = made_with(plan.described_worlds, plan.errors, methods)
    check_outputs(output, replace)
    results = plan.map(methods)
    data = {**to_data(results), "command": plan.command, "made_with": made}
    if failed := failures(results):
        data["failed"] = failed
    figures = output.with_suffix(".json")
    write_file(figures, json.dumps(data, indent=1).encode())  # first, as it has everything
    tables = [table for world in data["worlds"] for table in tables_of(world)]
    save_tables(tables, tables_folder(output))
    write_report(results, data, output, plan.command)
    if as_json:
        say_json(data)
    else:
        for world in data["worlds"]:
            _show(world)
        say(f"\nreport   {output}\nfigures  {figures}\ntables   {tables_folder(output)}")
    if failed:
        raise HypermapError("; ".join(failed.values()))


def _show(world: Data) -> None:
    from hypermap.experiments.methods import OURS
    from hypermap.experiments.thesis_tables import gains_table, methods_table

    show(methods_table(world))
    if OURS in world["methods"] and len(world["methods"]) > 1:
        show(
            gains_table(world).only(
                "method", "gain in IoU", "p (IoU)", "nearer by [m]", "p (nearer)"
            )
        )
    bound = world["bound"]
    say(
        f"found by the detector at all: {bound['detected']:.2f} of the objects, in two frames or "
        f"more {bound['detected_twice']:.2f}, which bounds recall"
    )
