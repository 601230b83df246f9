"""The evidence for the objects of a layer, for a page that has no server."""

from __future__ import annotations

from typing import Any

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.text import counted
from hypermap.viewer.live.object_evidence import describe_evidence

MAX_OBSERVATIONS = 20_000
"""How many observations of a layer a page holds; some five megabytes."""


def embed_evidence(
    hypermap: Hypermap, layer: Layer, most: int = MAX_OBSERVATIONS
) -> tuple[dict[str, Any], str]:
    """Return what is behind the objects of a layer by their ids, and a note if it is not all.

    Objects in the order of their ids have theirs, until there are `most` observations.
    """
    if not isinstance(layer, SemanticLayer):
        return {}, ""
    try:
        evidence = layer.evidence()
    except HypermapError as error:
        return {}, f"layer {layer.name!r} is shown without evidence: {error}"
    if evidence is None:
        return {}, ""
    ids, counts = np.unique(evidence.object_ids, return_counts=True)
    taken = np.flatnonzero(np.cumsum(counts) <= most)
    document = {
        str(number): describe_evidence(hypermap, layer.name, number)
        for number in ids[taken].tolist()
    }
    if len(taken) == len(ids):
        return document, ""
    missing = counted(len(ids) - len(taken), "object")
    return document, f"layer {layer.name!r}: the evidence for {missing} is not in this file"
