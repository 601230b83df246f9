"""The evidence map in a synthetic hall: its speed, and how that changes as the map grows.

All frames are made beforehand, five things and the ends of the rays of a depth image each. Each run
gets fresh copies, so that nothing that was computed from a frame is there already.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np
import shapely

from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.perception.observation import Observation
from suite.hall import PER_FRAME, Hall
from suite.plain_evidence import PlainEvidenceMap
from suite.race import Disagreement, Figure, Growth, Race, Row, Settings, each_of, seconds_of

_SEED = 7
_SAME = 1e-9  # square meters by which two shapes may differ
_HELD = "memory: the evidence map, pickled"


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the speed of both profiles, and how the time grows."""
    return each_of(
        settings,
        {
            "profile thesis": _thesis,
            "profile default": _default,
            "growth with evidence": _growth_with_evidence,
            "growth with objects": _growth_with_objects,
        },
    )


def _thesis(settings: Settings) -> Iterator[Row]:
    """Race against the same rules in plain shapely; the figure is that of the same runs."""
    made, fill, count = _hall(200, settings)
    ours, theirs = [], []
    agreement = ""
    for _ in range(settings.repeat + 1):
        ours_map, plain = EvidenceMap(profile("thesis").evidence), PlainEvidenceMap()
        ours.append(_seconds(ours_map.update, made, fill))
        theirs.append(_seconds(plain.update, made, fill))
        agreement = _agreement(ours_map, plain)
    del ours[0], theirs[0]  # the first run loads compiled code
    work = f"evidence, profile thesis, {len(ours_map)} objects, {count} frames"
    rates = tuple(count / seconds for seconds in ours)
    note = "the C++ program of 2019 did 6,000 with its logging off, and 222 with it on"
    yield Figure(work, rates, "frames/s", asked=2000, note=note)
    peer = f"the same rules in plain shapely {shapely.__version__}"
    yield Race(work, peer, tuple(ours), tuple(theirs), agreement)


def _default(settings: Settings) -> Iterator[Row]:
    for objects in (100, 200):
        made, fill, count = _hall(objects, settings)
        seconds = []
        for _ in range(settings.repeat + 1):
            evidence = EvidenceMap(profile("default").evidence)
            seconds.append(_seconds(evidence.update, made, fill))
        per_frame = np.array(seconds[1:]) / count
        work = f"evidence, profile default, rays included, {len(evidence)} objects, {count} frames"
        note = f"{1 / np.median(per_frame):.0f} frames/s"
        asked = 5 if objects == 100 else None
        yield Figure(work, tuple((1e3 * per_frame).tolist()), "ms per frame", asked, True, note)


def _growth_with_evidence(settings: Settings) -> Iterator[Row]:
    """Show the same five things again and again."""
    sizes = (1, 10, 100, 1000) if settings.quick else (1, 10, 100, 1000, 10_000)
    frames = Hall(50, np.random.default_rng(_SEED)).frames_from_one_place(sizes[-1])
    made = pickle.dumps(frames)
    for name in ("thesis", "default"):
        seconds, held = [], []
        for size in (sizes[0], *sizes):
            evidence = EvidenceMap(profile(name).evidence)
            some = pickle.loads(made)[:size]
            seconds.append(_seconds_to_take_in(evidence.update, some))
            held.append(len(pickle.dumps(evidence)))
        del seconds[0], held[0]  # the first run loads compiled code
        work = f"evidence for each of five objects, profile {name}"
        yield Growth(work, "evidence", sizes, tuple(seconds), tuple(held), note=_HELD)


def _growth_with_objects(settings: Settings) -> Iterator[Row]:
    """Show each thing of larger and larger halls three times or so."""
    sizes = (100, 316, 1000) if settings.quick else (100, 1000, 10_000)
    halls = [Hall(size, np.random.default_rng(_SEED)) for size in sizes]
    made = [pickle.dumps(hall.frames(3 * len(hall.places) // PER_FRAME)) for hall in halls]
    for name in ("thesis", "default"):
        seconds, held = [], []
        for frames in made:
            evidence = EvidenceMap(profile(name).evidence)
            seconds.append(_seconds_to_take_in(evidence.update, pickle.loads(frames)))
            held.append(len(pickle.dumps(evidence)))
        work = f"evidence of objects seen three times each, profile {name}"
        yield Growth(work, "objects", sizes, tuple(seconds), tuple(held), note=_HELD)


@lru_cache
def _hall(objects: int, settings: Settings) -> tuple[bytes, int, int]:
    """Return pickled frames of a hall, how many fill the map, and how many follow."""
    fill, count = (objects, 50) if settings.quick else (2 * objects, 600)
    frames = Hall(objects, np.random.default_rng(_SEED)).frames(fill + count)
    return pickle.dumps(frames), fill, count


def _seconds(update: Callable[[Observation], None], made: bytes, fill: int) -> float:
    """Return the seconds that the frames take that follow those which fill the map."""
    frames = pickle.loads(made)
    for frame in frames[:fill]:
        update(frame)
    return _seconds_to_take_in(update, frames[fill:])


def _seconds_to_take_in(update: Callable[[Observation], None], frames: list[Observation]) -> float:
    def all_frames() -> None:
        for frame in frames:
            update(frame)

    return seconds_of(all_frames)[0]


def _agreement(ours: EvidenceMap, plain: PlainEvidenceMap) -> str:
    """Compare all objects.

    Raises:
        Disagreement: If one is missing, or existence, amount of evidence or shape differ.
    """
    objects, others = ours.objects(), plain.objects()
    facts = [(o.name, o.existence, o.attributes["evidence"]) for o in objects]
    expected = [(o.name, o.existence, len(o.evidence)) for o in others]
    if facts != expected:
        raise Disagreement(f"{len(facts)} objects differ from the peer's {len(expected)}")
    shapes = [o.footprint for o in objects], [o.shape for o in others]
    worst = float(shapely.area(shapely.symmetric_difference(*shapes)).max(initial=0))
    if worst > _SAME:
        raise Disagreement(f"a shape differs by {worst:g} m²")
    return f"the same {len(facts)} objects, existence and shapes"
