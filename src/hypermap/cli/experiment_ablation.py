"""`hypermap experiment ablation`: our method without each of its parts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.experiment_plan import Plan
from hypermap.cli.experiment_tables import check_outputs, show, tables_folder
from hypermap.cli.terminal import say, say_json
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.mapping.config import MappingConfig


def run(plan: Plan, output: Path | None, as_json: bool, replace: bool) -> None:
    """Map all drives without each part, show what that changes, and save it."""
    from hypermap.experiments.ablation import chosen_parts, tables_of
    from hypermap.experiments.ablation_report import to_data, write_report
    from hypermap.experiments.figures import made_with
    from hypermap.experiments.tables import save_tables
    from hypermap.formats.atomic import write_file

    output = output or Path("ablation.html")
    name, whole = _configuration(plan.added)
    parts = chosen_parts(whole, plan.parts)
    made = made_with(plan.described_worlds, plan.errors, parts)
    check_outputs(output, replace)
    results = plan.map(parts)
    tables = tables_of(results)
    data = {"method": name, **to_data(results), "command": plan.command, "made_with": made}
    figures = output.with_suffix(".json")
    write_file(figures, json.dumps(data, indent=1).encode())  # first, as it has everything
    save_tables(tables, tables_folder(output))
    write_report(tables, output, name, plan.command)
    if as_json:
        say_json(data)
        return
    for table in tables:
        show(table.only("without", "IoU", "F1 at 0.25", "F1 at 0.5"))
    say(f"\nreport   {output}\nfigures  {figures}\ntables   {tables_folder(output)}")


def _configuration(added: tuple[str, ...]) -> tuple[str, MappingConfig]:
    """Return the configuration that is taken apart, and its name."""
    from hypermap.experiments.methods import OURS, named_method
    from hypermap.mapping.config import MappingConfig, profile

    if not added:
        return OURS, profile(OURS)
    if len(added) > 1:
        raise HypermapError("--method: an ablation is of one method; give one")
    name, method = named_method(added[0])
    if not isinstance(method, MappingConfig):
        raise HypermapError(
            f"--method {name}: it is code ({method.source}), and only a configuration has parts "
            "that can be left out"
        )
    return name, method
