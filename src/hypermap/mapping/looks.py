"""Embeds what frames show of each object, so that objects can be found by their appearance."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from hypermap.core.embeddings import Embedding
from hypermap.core.errors import HypermapError
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.pictures import is_person
from hypermap.perception.detections import Detections
from hypermap.perception.embedders.embedder import Embedder
from hypermap.perception.frame import RgbdFrame

_log = logging.getLogger(__name__)

_LEAST = 10  # pixels; smaller boxes show nothing


def embed_objects(
    frame: RgbdFrame,
    detections: Detections,
    evidence: EvidenceMap,
    embedder: Embedder,
    people: bool = False,
) -> None:
    """Add the embedding of each object in a frame to its track.

    The embedding of an object is the mean over its views, weighted by their scores. A frame without
    color adds nothing, nor does one for which the embedder fails, which is logged.

    Args:
        frame: the frame of the last update of the evidence map.
        detections: the detections of its objects.
        evidence: keeps the embeddings; changed.
        embedder: encodes the boxes of the detections.
        people: whether people are embedded, too.
    """
    views: list[tuple[int, float, NDArray[np.float32]]] = []
    for observed, track_id in evidence.shown:
        is_one = any(map(is_person, (observed.name, evidence.class_of(track_id))))
        if observed.detection is not None and (people or not is_one):
            views.append((track_id, observed.score, detections.xyxy[observed.detection]))
    if not views:
        return
    try:
        color = frame.color
        if color is None:
            return
        crops = [(view, _crop(color, view[2])) for view in views]
        crops = [(view, crop) for view, crop in crops if min(crop.shape) > 0]
        if not crops:
            return
        vectors = embedder.images([crop for _, crop in crops])
    except HypermapError as error:  # a map does not need it
        _log.warning("frame %.6f: no object was embedded: %s", frame.stamp, error)
        return
    for ((track_id, score, _), _crop_of), vector in zip(crops, vectors, strict=True):
        total = np.asarray(vector, dtype=np.float32) * np.float32(score)
        evidence.add_embedding(track_id, Embedding(embedder.model, total))


def _crop(color: NDArray[np.uint8], box: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the pixels of a box; none if too few of them are in the image."""
    low = np.maximum(np.floor(box[:2]), 0).astype(int)
    high = np.minimum(np.ceil(box[2:]), color.shape[1::-1]).astype(int)
    if (high - low).min() < _LEAST:
        return color[:0, :0]
    return color[low[1] : high[1], low[0] : high[0]]
