"""Saves the map of `hypermap map`, and says what is in it and what became of the frames."""

from __future__ import annotations

import shlex
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from hypermap.cli.change_rows import summary_of
from hypermap.cli.onto import is_same_file
from hypermap.cli.saving import replace_from
from hypermap.cli.terminal import note
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.mapping.config import MappingConfig
    from hypermap.mapping.counts import Counts


def save_result(hypermap: Hypermap, output: Path, evidence: bool, onto: Path | None) -> None:
    """Save the map, without its evidence if the user drops it, and keep what it replaces.

    Raises:
        HypermapError: If it cannot be saved there; it names the folder for temporary files in which
            the map is then, if it could be saved there.
    """
    from hypermap.formats.backup import or_elsewhere

    if not evidence:
        _drop_evidence(hypermap)
    with or_elsewhere(output.name, lambda: hypermap):
        backup = replace_from(hypermap, onto, output)
    if backup is not None:
        note(f"the previous map is kept as {backup}" + _hint_onto(backup, output, onto))


def _hint_onto(backup: Path, output: Path, onto: Path | None) -> str:
    """Return a hint at --onto, if a map that could have been continued was replaced."""
    from hypermap.formats.backup import may_go_on

    if is_same_file(output, onto) or not may_go_on(backup):
        return ""
    return f"; the new map does not continue it (--onto {shlex.quote(str(output))} would)"


def note_frames(
    hypermap: Hypermap, counts: Counts, settings: MappingConfig, seconds: float, rate: float | None
) -> None:
    """Say what became of the frames; `rate` is their number per second once code is loaded."""
    from hypermap.mapping.corrections import NO_MAP, sentence

    pace = f" ({rate:.1f}/s after the first, which loads compiled code)" if rate else ""
    note(
        f"{counted(counts.frames, 'frame')} in {seconds:.1f} s{pace}: {counts.used} used, "
        f"{counts.skipped} skipped because the camera had hardly moved, "
        f"{counts.unusable} unusable"
    )
    if counts.repeated:
        note(f"{counted(counts.repeated, 'frame')} already in the map, not counted again")
    if surplus := hypermap.metadata.get("surplus_detections"):
        note(
            f"{counted(surplus, 'detection')} left out: only the best "
            f"{settings.perception.max_detections} of a frame are used "
            "(perception: max_detections in --config)"
        )
    if corrections := hypermap.metadata.get("pose_corrections"):
        note(sentence(corrections))
        if corrections["as_recorded"].get(NO_MAP) == counts.used:
            note(
                "warning: the map has no border of free space near any place of the camera; is it "
                "of this place, and in the frame of the poses?"
            )
    elif settings.alignment.enabled and hypermap.metadata["poses"] == "as recorded":
        note(
            "poses were used as recorded; if they drift, --correct-poses graph corrects them "
            "without an occupancy map"
        )


def note_unseen(hypermap: Hypermap, settings: MappingConfig) -> None:
    """Name the objects that mapping would have removed if nobody had edited them by hand."""
    from hypermap.formats.backup import BY_HAND
    from hypermap.mapping.going_on import layer_of_objects

    for item in layer_of_objects(hypermap) or ():
        is_there = item.existence is None or item.existence > settings.evidence.publish_above
        if BY_HAND in item.attributes and not is_there:
            note(
                f"object {item.id} ({printable(item.name)}) was not found again, but stays because "
                "it was edited by hand"
            )


def _drop_evidence(hypermap: Hypermap) -> None:
    from hypermap.core.semantic import SemanticLayer

    hypermap.mapper_state = None
    for layer in hypermap:
        if isinstance(layer, SemanticLayer):
            layer.kept_evidence = None


def summarize(hypermap: Hypermap, output: Path, onto: Path | None) -> None:
    """Say what is in the saved map, what is new in it since `onto`, and what to try next."""
    from hypermap.mapping.going_on import layer_of_objects

    layer = layer_of_objects(hypermap)
    names = Counter[str]() if layer is None else Counter(map(str, layer.names))
    listed = ", ".join(f"{count} {printable(name)}" for name, count in names.most_common())
    if layer is not None:
        note(counted(names.total(), "object") + (f": {listed}" if listed else ""))
    version = None if onto is None else _note_changes(hypermap, onto)
    note(f"saved {output}")
    made, picture = str(output), str(output.with_suffix(".png"))
    note("\nnow try:  " + shlex.join(["hypermap", "view", made]))
    note("          " + shlex.join(["hypermap", "render", made, "-o", picture]))
    if layer is not None:
        name = printable(next(iter(names), "chair"))
        note("          " + shlex.join(["hypermap", "query", made, "--name", name, "--nearest"]))
    if version is not None:
        note("          " + shlex.join(["hypermap", "changes", made, "--since", f"v{version}"]))


def _note_changes(hypermap: Hypermap, onto: Path) -> int | None:
    """Say what this drive has changed; return the version before it, None if it changed nothing."""
    revision = hypermap.history.revisions()[-1] if hypermap.history is not None else None
    if revision is None or not revision.changes:
        note(f"nothing changed since {onto}")
        return None
    note(f"since {onto}: {summary_of(revision)}")
    return revision.version - 1
