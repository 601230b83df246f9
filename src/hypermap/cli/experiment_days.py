"""`hypermap experiment days`: what maps say of worlds that change from day to day."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypermap.cli.experiment_plan import Plan
from hypermap.cli.options import check_output
from hypermap.cli.progress import counting
from hypermap.cli.terminal import out, say, say_json, table

if TYPE_CHECKING:
    from hypermap.experiments.days import Counts, Tally


def run(plan: Plan, output: Path | None, as_json: bool, replace: bool) -> None:
    """Map all series, show what came of them, and save it as JSON."""
    from hypermap.experiments.days import Series, map_series
    from hypermap.experiments.figures import made_with
    from hypermap.formats.atomic import write_file
    from hypermap.mapping.config import profile
    from hypermap.simulation import varied

    figures = output or Path("days.json")
    check_output(figures, replace)
    found: dict[str, list[Tally]] = {}
    series = [
        Series(varied(world, seed), seed, plan.errors, plan.rate, plan.drives)
        for world in plan.described_worlds
        for seed in plan.seed_range
    ]
    config = profile("default")
    with counting("mapping", len(series), "series of drives", "series of drives") as count:
        for tally in map_series(series, config, plan.jobs):
            found.setdefault(tally.world, []).append(tally)
            count()
    data: dict[str, Any] = {
        "drives": plan.drives,
        "rate": plan.rate,
        "seeds": list(plan.seed_range),
        "worlds": {name: _figures(tallies) for name, tallies in found.items()},
        "series": [_record(tally) for tallies in found.values() for tally in tallies],
        "command": plan.command,
        "made_with": made_with(plan.described_worlds, plan.errors, {"default": config}),
    }
    write_file(figures, json.dumps(data, indent=1).encode())
    if as_json:
        say_json(data)
        return
    for name, world in data["worlds"].items():
        _show(name, world)
    say(f"\nfigures  {figures}")


def _record(tally: Tally) -> dict[str, Any]:
    counts = {name: vars(getattr(tally, name)) for name in ("looked", "in_sight", "alike")}
    return {**vars(tally), **counts}


def _figures(tallies: Sequence[Tally]) -> dict[str, Any]:
    """Return the figures of a world over all its series."""
    causes = sum((tally.causes for tally in tallies), Counter[str]())
    kept, switched = (sum(getattr(t, name) for t in tallies) for name in ("kept", "switched"))
    swapped, said = (sum(getattr(t, n) for t in tallies) for n in ("swapped", "swapped_found"))
    return {
        "changes": _changes([tally.looked for tally in tallies]),
        "changes_in_sight": _changes([tally.in_sight for tally in tallies]),
        "changes_of_things_that_sizes_tell": _changes([tally.alike for tally in tallies]),
        "causes": dict(causes.most_common()),
        "swapped": {"true": swapped, "reported_as_moved": said},
        "id_switches": _share(switched, kept),
        "kept": kept,
        "first_map": _precision_and_recall([tally.first for tally in tallies]),
        "last_map": _precision_and_recall([tally.last for tally in tallies]),
    }


def _changes(counts: Sequence[Counts]) -> dict[str, Any]:
    """Return precision, recall and F1 of each kind of change."""
    from hypermap.experiments.days import KINDS

    changes = {}
    for kind in KINDS:
        true, right, said = (
            sum(getattr(one, name)[kind] for one in counts)
            for name in ("true", "right", "reported")
        )
        changes[kind] = {
            "true": true,
            "precision": _share(right, said),
            "recall": _share(right, true),
            "f1": _share(2 * right, true + said),
        }
    return changes


def _precision_and_recall(counts: Sequence[tuple[int, int, int]]) -> dict[str, float | None]:
    found, true, matched = map(sum, zip(*counts, strict=True))
    return {"precision": _share(matched, found), "recall": _share(matched, true)}


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _show(name: str, world: dict[str, Any]) -> None:
    from hypermap.experiments.tables import number

    columns = ("changes", "precision", "recall", "F1", "F1 in sight", "F1 as sizes tell")
    rows = table("kind", *columns, right=columns)
    for kind, row in world["changes"].items():
        others = ("changes_in_sight", "changes_of_things_that_sizes_tell")
        f1s = (world[name][kind]["f1"] for name in others)
        shares = (row["precision"], row["recall"], row["f1"], *f1s)
        rows.add_row(kind, str(row["true"]), *map(number, shares))
    say(f"\n{name}\n")
    out().print(rows)
    _show_causes(world["causes"])
    swapped = world["swapped"]
    say(f"of {swapped['true']} swapped, {swapped['reported_as_moved']} are said to have moved")
    switches = world["id_switches"]
    share = "-" if switches is None else f"{switches:.1%}"
    say(f"ids that changed: {share} of {world['kept']}")
    for when in ("first_map", "last_map"):
        shares = world[when]
        words = (f"{key} {number(shares[key])}" for key in ("precision", "recall"))
        say(f"{when.replace('_', ' ')}: {', '.join(words)}")


def _show_causes(causes: dict[str, int]) -> None:
    """Show how many errors of each kind each cause has."""
    from hypermap.experiments.day_causes import CAUSES
    from hypermap.experiments.days import KINDS

    kinds = [f"{error} {kind}" for kind in KINDS for error in ("missed", "wrong")]
    rows = table("cause", *kinds, right=kinds)
    for cause in CAUSES:
        counts = [causes.get(f"{kind}: {cause}", 0) for kind in kinds]
        if any(counts):
            rows.add_row(cause, *(str(count or "") for count in counts))
    say("")
    out().print(rows)
