"""Ablation: a configuration without each of its parts in turn, compared drive by drive."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.evaluation.significance import Effect, effect_of
from hypermap.experiments.results import MEASURES, WorldResult, mean
from hypermap.experiments.tables import Column, Interval, Table
from hypermap.mapping.config import MappingConfig
from hypermap.text import counted

WHOLE = "nothing"
"""What is left out of the whole configuration."""


def without_parts(whole: MappingConfig) -> dict[str, MappingConfig]:
    """Return a configuration, and the same without each of its parts, by what is left out.

    A part that it does not have is not in the list.
    """

    def perception(**changed: Any) -> MappingConfig:
        return replace(whole, perception=replace(whole.perception, **changed))

    def evidence(**changed: Any) -> MappingConfig:
        return replace(whole, evidence=replace(whole.evidence, **changed))

    parts = {
        WHOLE: whole,
        "cutting at the box": perception(max_cut=0.0),
        "rejection of what fits no box": perception(min_fit=0.0),
        "smoothing of depth": perception(smoothing=0),
        "rejection of flying pixels": perception(min_support=0),
        "rejection of floor pieces": perception(min_top=0.0),
        "rejection of unusual sizes": evidence(class_sizes="any"),
        "tolerance of association": evidence(slack=0.0),
        "exclusive objects": evidence(exclusive=False),
        "sizes of merged objects": evidence(max_growth=math.inf),
        "voting: best shape": evidence(fusion="best_shape"),
        "voting: convex hull": evidence(fusion="convex_hull"),
        "walls in the vote": evidence(abstain="outside"),
        "near views weighted": evidence(half_weight=math.inf),
        "alignment of footprints": evidence(align=0.0),
        "landmarks": evidence(landmarks=False),
        "completion": evidence(completion="none"),
        "gain by score": evidence(gain_by_score=False),
        "rays": evidence(sight="area"),
        "estimated detection rate": evidence(detection_rate="fixed"),
        "probability": evidence(min_probability=0.0),
        "see-throughs": evidence(gone_loss=whole.evidence.loss),
        "conflicts": evidence(contested=0.0),
        "one class per place": evidence(slip=1.0),
        "moves": evidence(moves=False),
        "pose correction": replace(whole, alignment=replace(whole.alignment, enabled=False)),
    }
    return {name: config for name, config in parts.items() if name == WHOLE or config != whole}


def chosen_parts(whole: MappingConfig, words: str) -> dict[str, MappingConfig]:
    """Return the whole and the parts whose names begin with one of some words; all for "all".

    Raises:
        HypermapError: If a word is the beginning of no part's name.
    """
    known = without_parts(whole)
    if words == "all":
        return known
    beginnings = tuple(words.split(","))
    parts = [name for name in known if name != WHOLE]
    for word in beginnings:
        if not word or not any(name.startswith(word) for name in parts):
            raise HypermapError(
                f"the configuration has no part {word!r} that can be left out; it has: "
                f"{', '.join(parts)}"
            )
    return {n: c for n, c in known.items() if n == WHOLE or n.startswith(beginnings)}


@dataclass(frozen=True)
class Row:
    """What leaving a part out does.

    Attributes:
        part: its name; `WHOLE` for nothing.
        means: of each of `MEASURES` over the drives; None where no drive defines it.
        changes: of each, against the whole: without the part minus with it, paired by drive; None
            for the whole, and where no drive defines both.
    """

    part: str
    means: Mapping[str, float | None]
    changes: Mapping[str, Effect | None]


def rows_of(results: Sequence[WorldResult]) -> list[Row]:
    """Return a row for each part, over all drives through some worlds.

    Args:
        results: whose methods are those of `without_parts`.
    """
    parts = list(results[0].evaluations)
    figures = {part: _figures(results, part) for part in parts}
    return [
        Row(
            part,
            {measure: mean(values) for measure, values in figures[part].items()},
            {
                measure: None if part == WHOLE else _change(values, figures[WHOLE][measure])
                for measure, values in figures[part].items()
            },
        )
        for part in parts
    ]


def _figures(results: Sequence[WorldResult], part: str) -> dict[str, list[float | None]]:
    """Return each measure of each drive."""
    scores = [one.overall for result in results for one in result.evaluations[part]]
    return {name: [measure.of(score) for score in scores] for name, measure in MEASURES.items()}


def _change(without: Sequence[float | None], whole: Sequence[float | None]) -> Effect | None:
    pairs = zip(without, whole, strict=True)
    changes = [a - b for a, b in pairs if a is not None and b is not None]
    return effect_of(changes) if changes else None


def tables_of(results: Sequence[WorldResult]) -> list[Table]:
    """Return two tables for each world, and two for all together if there are several."""
    names = [result.world.name for result in results]
    scopes = [(name, name, [result]) for name, result in zip(names, results, strict=True)]
    if len(results) > 1:
        scopes.append(("all", "all worlds", list(results)))
    return [table for scope in scopes for table in _tables(*scope)]


def _tables(name: str, where: str, results: Sequence[WorldResult]) -> tuple[Table, Table]:
    rows, count = rows_of(results), sum(len(result.mapped) for result in results)
    drives = counted(count, "drive")
    columns = (Column("without"), *(Column(measure.title) for measure in MEASURES.values()))
    means = Table(
        f"{name}-means",
        f"{where}: means over {drives}",
        columns,
        tuple((row.part, *(row.means[key] for key in MEASURES)) for row in rows),
        (WHOLE,),
    )
    changes = Table(
        f"{name}-changes",
        f"{where}: change of each figure if the part is left out, with its 95 % interval "
        f"(Student's t over {drives}, paired)",
        columns,
        tuple(
            (row.part, *(interval_of(row.changes[key]) for key in MEASURES))
            for row in rows
            if row.part != WHOLE
        ),
    )
    return changes, means


def interval_of(effect: Effect | None) -> Interval | None:
    """Return an effect as a cell."""
    return None if effect is None else Interval(effect.mean, effect.low, effect.high)
