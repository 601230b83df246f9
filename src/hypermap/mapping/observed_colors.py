"""The colors of the objects that a mapped frame shows.

Decoding a color image may take as long as mapping its frame, so this is done only where an object
has few colors of this drive yet.
"""

from __future__ import annotations

import logging
from dataclasses import replace

from hypermap.core.errors import HypermapError
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.paint import Rgb, median_color

_log = logging.getLogger(__name__)


def with_colors(frame: RgbdFrame, observation: Observation, evidence: EvidenceMap) -> Observation:
    """Return an observation whose objects have their colors, if any of these has too few yet.

    Args:
        frame: the frame of the last update of the evidence map.
        observation: what it shows.
        evidence: gets the colors, too; changed.
    """
    if not evidence.lacks_colors(observation.stamp):
        return observation
    try:
        colors = colors_of(frame, observation)
    except HypermapError as error:  # a map does not need it
        _log.info("frame %.6f: its objects have no color: %s", frame.stamp, error)
        return observation
    evidence.add_colors(observation.stamp, colors)
    objects = (replace(one, color=colors.get(one)) for one in observation.objects)
    return replace(observation, objects=tuple(objects))


def colors_of(frame: RgbdFrame, observation: Observation) -> dict[ObservedObject, Rgb | None]:
    """Return the color of each object of a frame, None for several; no colors if it has none.

    Raises:
        HypermapError: If the color image cannot be read.
    """
    color = frame.color
    if color is None:
        return {}
    return {
        one: median_color(color, one.pixels)
        for one in observation.objects
        if one.pixels is not None
    }


def colors_in(observation: Observation) -> dict[ObservedObject, Rgb]:
    """Return the colors that the objects of an observation have."""
    return {one: one.color for one in observation.objects if one.color is not None}
