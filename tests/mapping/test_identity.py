"""A map keeps its id, its version counts up, and its drives are listed."""

from __future__ import annotations

import dataclasses
import logging
import os
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map, save_map
from hypermap.formats.backup import why_precious
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.viewer.live.document import MapDocument

from .test_mapper import CONFIG, Frames, boxes, frame, walk


def identity(hypermap: Hypermap) -> tuple[str, int]:
    return hypermap.metadata["map_id"], hypermap.metadata["map_version"]


def test_the_same_recording_and_configuration_give_the_same_new_map() -> None:
    map_id, version = identity(map_recording(walk(), boxes, CONFIG))
    assert version == 1
    assert identity(map_recording(walk(), boxes, CONFIG)) == (map_id, 1)
    others = [
        map_recording(dataclasses.replace(walk(), path=Path("run")), boxes, CONFIG),
        map_recording(Frames([frame(9)]), boxes, CONFIG),
        map_recording(walk(), boxes, profile("thesis")),
    ]
    assert len({map_id, *(identity(other)[0] for other in others)}) == 4


def test_the_same_images_with_the_poses_of_another_slam_are_another_map() -> None:
    aside = np.eye(4)
    aside[0, 3] = 3.0
    seen = list(walk().frames())
    moved = [dataclasses.replace(f, map_T_camera=aside @ f.map_T_camera) for f in seen]
    one, other = (map_recording(Frames(frames), boxes, CONFIG) for frames in (seen, moved))
    assert identity(one)[0] != identity(other)[0]


def test_noise_of_the_last_digits_of_poses_does_not_make_another_map() -> None:
    found = set()
    for noise in (1e-12, -1e-12):
        seen = [
            dataclasses.replace(f, map_T_camera=f.map_T_camera + noise * np.eye(4, k=1))
            for f in walk(3).frames()
        ]
        found.add(identity(map_recording(Frames(seen), boxes, CONFIG))[0])
    assert len(found) == 1


def test_a_recording_whose_name_is_not_unicode_is_mapped_and_saved(tmp_path: Path) -> None:
    recording = dataclasses.replace(walk(), path=Path(os.fsdecode(b"caf\xe9")))
    save_map(map_recording(recording, boxes, CONFIG), tmp_path / "a.hmap")
    metadata = open_map(tmp_path / "a.hmap").metadata
    assert metadata["recording"] == metadata["drives"][0]["name"] == "caf\ufffd"


def test_a_map_with_what_people_have_done_is_not_replaced_without_asking(tmp_path: Path) -> None:
    first = map_recording(walk(3), boxes, CONFIG)
    first.semantic().rename(0, "Anna's box")
    save_map(map_recording(walk(), boxes, CONFIG, onto=first), tmp_path / "a.hmap")
    assert why_precious(tmp_path / "a.hmap") == "it was edited by hand"


def test_the_id_stays_and_the_version_counts_up_with_drives_and_edits(tmp_path: Path) -> None:
    path = tmp_path / "a.hmap"
    first = map_recording(walk(3), boxes, CONFIG)
    save_map(first, path)
    document = MapDocument(path)
    document.save()  # nothing has changed
    assert identity(open_map(path)) == identity(first)
    for version in (2, 3):
        now = document.current
        box = now.hypermap.semantic().get(0)
        renamed = dataclasses.replace(box, name=f"name {version}")
        document.edit(now.version, lambda draft, to=renamed: draft.update("semantic", 0, to))
        document.save()
        assert identity(open_map(path)) == (first.metadata["map_id"], version)
    made = map_recording(walk(), boxes, CONFIG, onto=open_map(path))
    assert identity(made) == (first.metadata["map_id"], 4)


def test_a_clock_that_is_ahead_is_told_and_gives_no_time(caplog: pytest.LogCaptureFixture) -> None:
    ahead = [dataclasses.replace(frame(i), stamp=9e9 + i) for i in range(3)]
    with caplog.at_level(logging.WARNING):
        made = map_recording(Frames(ahead), boxes, CONFIG)
        assert "lie in the future (2255-03-14" in caplog.text
        map_recording(Frames(ahead), boxes, CONFIG, onto=made)  # nothing new
        assert "earlier drive" not in caplog.text
        now = [dataclasses.replace(f, stamp=1.7e9 + i) for i, f in enumerate(walk().items)]
        map_recording(Frames(now), boxes, CONFIG, onto=made)
    assert "earlier drive 'walk' lie in the future (2255-03-14" in caplog.text
    assert made.history is not None
    assert made.history.mapped is not None
    assert made.history.mapped.time is None


def test_a_clock_that_was_never_set_is_told_where_others_were(
    caplog: pytest.LogCaptureFixture,
) -> None:
    dated = [dataclasses.replace(f, stamp=1.7e9 + i) for i, f in enumerate(walk().items)]
    undated = [dataclasses.replace(f, stamp=5.0 + i) for i, f in enumerate(walk().items)]
    with caplog.at_level(logging.WARNING):
        first = map_recording(Frames(dated), boxes, CONFIG)
        map_recording(Frames(undated), boxes, CONFIG)
        assert "count from 1970" not in caplog.text
        made = map_recording(Frames(undated), boxes, CONFIG, onto=first)
    assert "do not count from 1970 (10.000 s), as those of earlier drives do" in caplog.text
    assert "what has moved or is gone since then may stay where it was" in caplog.text
    assert made.history is not None
    assert made.history.mapped is not None
    assert made.history.mapped.time is None


def test_a_clock_that_is_set_on_the_way_is_told(caplog: pytest.LogCaptureFixture) -> None:
    parked = [dataclasses.replace(f, stamp=1.7e9 + 86_400 * i) for i, f in enumerate(walk().items)]
    reset = [dataclasses.replace(f, stamp=f.stamp + 1.7e9 * (f.stamp > 2)) for f in walk().items]
    with caplog.at_level(logging.WARNING):
        map_recording(Frames(parked), boxes, CONFIG)
        assert "jump" not in caplog.text
        map_recording(Frames(reset), boxes, CONFIG)
    assert "jump from 1970-01-01T00:00:02Z to 2023-11-14T22:13:23Z" in caplog.text


def test_drives_whose_clocks_begin_again_are_hours_apart_unless_they_are_one() -> None:
    def drive(start: float, count: int) -> Frames:
        items = [dataclasses.replace(f, stamp=start + i) for i, f in enumerate(walk().items)]
        return Frames(items[:count])

    def last_seen(recording: Frames, onto: Hypermap) -> float:
        made = map_recording(recording, boxes, CONFIG, onto=onto)
        return max(one.last_seen for one in made.semantic().objects() if one.last_seen is not None)

    first = map_recording(drive(0.0, 3), boxes, CONFIG)
    assert last_seen(drive(0.0, 6), first) == 5  # the rest of the same drive
    begins_alike = Frames([*drive(0.0, 1).items, *drive(0.5, 6).items], path=Path("second"))
    assert last_seen(begins_alike, first) == 2 + 7200 + 4  # its second frame is where the first was
    assert last_seen(drive(100.0, 6), first) == 105  # the clock goes on
    assert last_seen(drive(0.5, 6), first) == 2 + 7200 + 5
    twice = Frames([*drive(0.5, 6).items, *drive(0.0, 3).items])  # of two recordings
    assert last_seen(twice, first) == 2 + 7200 + 5
    later = dataclasses.replace(walk().items[-1], stamp=9.0)
    assert last_seen(Frames([*twice.items, later]), first) == 2 + 7200 + 8.5
    again = map_recording(drive(0.5, 6), boxes, CONFIG, onto=first)
    assert last_seen(drive(0.5, 6), again) == 2 + 7200 + 5  # nothing new
    assert last_seen(drive(0.25, 6), again) == 2 + 2 * (7200 + 5)
    assert last_seen(drive(1.7e9, 6), again) == 1.7e9 + 5  # a clock that is right


def test_a_drive_from_before_others_is_told(caplog: pytest.LogCaptureFixture) -> None:
    early, late = (
        Frames([dataclasses.replace(f, stamp=t + i) for i, f in enumerate(walk().items)])
        for t in (1.7e9, 1.7e9 + 1e5)
    )
    with caplog.at_level(logging.WARNING):
        map_recording(late, boxes, CONFIG, onto=map_recording(early, boxes, CONFIG))
        assert "map drives in order of time" not in caplog.text
        map_recording(early, boxes, CONFIG, onto=map_recording(late, boxes, CONFIG))
    assert "'walk' was before the drive 'walk', which the map knows already" in caplog.text
