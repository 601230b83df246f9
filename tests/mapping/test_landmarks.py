"""Frames that are off by different amounts come to agree on where the objects are."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity

from hypermap.core.semantic import SemanticObject
from hypermap.core.trajectory import trajectory_of
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.landmarks import landmark_moves
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.perceived import Perceived, Perceiver, no_detections
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig, KeyframeConfig
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.observation import Observation, ObservedObject

Array = NDArray[np.float64]

SIDES = (0.06, 0.4, 0.5, 0.8, 1.2)  # of a cup, and of four larger things
PLACES = np.array([[1.0, 0.2], [1.2, 0.6], [0.5, -0.4], [1.6, 0.1], [0.3, 0.9]])
CAMERA = np.array([-1.0, 0.0])
EVERYWHERE = shapely.box(-9, -9, 9, 9)


def drawn_errors(frames: int, position: float, turn: float = 0.0) -> Array:
    """Return x, y and turn by which the poses of frames are off, shape (frames, 3)."""
    rng = np.random.default_rng(3)
    return rng.normal(size=(frames, 3)) * [position, position, turn]


def centroid(place: Array, error: Array) -> Array:
    ray = place - CAMERA
    return np.asarray(place + error[:2] + error[2] * np.array([-ray[1], ray[0]]))


def pose(error: Array) -> Array:
    map_T_camera = np.eye(4)
    map_T_camera[:2, 3] = CAMERA + error[:2]
    return map_T_camera


def buffers_of(errors: Array, cup_in: Sequence[int], noise: float = 0.004) -> list[EvidenceBuffer]:
    """Return the evidence for all things, of which some frames alone show the cup."""
    rng = np.random.default_rng(4)
    buffers, area = [EvidenceBuffer(100) for _ in SIDES], PreparedPolygon.of(EVERYWHERE)
    for i, error in enumerate(errors):
        for thing, (buffer, side) in enumerate(zip(buffers, SIDES, strict=True)):
            xy = centroid(PLACES[thing], error) + rng.normal(size=2) * noise
            if thing > 0 or i in cup_in:
                shape = PreparedPolygon.of(shapely.Point(xy).buffer(side / 2))
                buffer.add(Evidence(i, pose(error), area, 0.8, shape, xy, 0.0, 0.5))
    return buffers


def test_a_cup_in_two_frames_comes_to_where_its_neighbors_say() -> None:
    buffers = buffers_of(drawn_errors(30, 0.04, 0.01), cup_in=[3, 4])
    cup = buffers[0]
    before = np.linalg.norm(cup.centroids.mean(axis=0) - PLACES[0])
    after = np.linalg.norm((cup.centroids + landmark_moves(buffers)[0]).mean(axis=0) - PLACES[0])
    assert before > 0.03
    assert after < 0.015


def test_exact_poses_stay_as_they_are() -> None:
    buffers = buffers_of(np.zeros((30, 3)), cup_in=[3, 12])
    assert not any(moves.any() for moves in landmark_moves(buffers))


def test_a_frame_is_not_pulled_by_one_thing_that_was_carried_away() -> None:
    errors = drawn_errors(20, 0.03)
    buffers = buffers_of(errors, cup_in=[])[1:]
    before = landmark_moves(buffers)[1]
    carried = list(buffers[0].items)
    for item in carried[-5:]:
        item.centroid_xy[:] += 0.5
    buffers[0] = EvidenceBuffer.of(carried, 100, 20, 16.0, 0.0, 19.0)
    assert np.abs(landmark_moves(buffers)[1] - before).max() < 0.02


def corrected_by(map_errors: Array, recorded_errors: Array) -> list[EvidenceBuffer]:
    """Return the evidence of things in groups, each in three visits, after poses were corrected.

    Args:
        map_errors: by which the map has each group elsewhere, shape (groups, 3).
        recorded_errors: of the recorded poses at each visit, shape (3, 3).
    """
    buffers: list[EvidenceBuffer] = []
    for group, error in enumerate(map_errors):
        away = np.array([3.0 * group, 0.0])
        items = [
            dataclasses.replace(
                item,
                stamp=1000 * visit + 10 * group + item.stamp,
                map_T_camera=moved(item.map_T_camera, away),
                centroid_xy=item.centroid_xy + away,
                prepared=PreparedPolygon.of(affinity.translate(item.footprint, *away)),
                correction=tuple(error - recorded_errors[visit]),
            )
            for visit in range(3)
            for buffer in buffers_of(np.array([error] * 4), cup_in=range(4))
            for item in buffer.items
        ]
        for thing in range(len(SIDES)):
            own = [item for i, item in enumerate(items) if i // 4 % len(SIDES) == thing]
            buffers.append(EvidenceBuffer.of(own, 100, len(own), 1.0, 0.0, 1.0))
    return buffers


def moved(map_T_camera: Array, by: Array) -> Array:
    pose = map_T_camera.copy()
    pose[:2, 3] += by
    return pose


def rms_error(buffers: Sequence[EvidenceBuffer], moves: Sequence[Array]) -> float:
    """Return by how much things are off in the mean of their views [m]."""
    off = []
    for n, (buffer, by) in enumerate(zip(buffers, moves, strict=True)):
        place = PLACES[n % len(SIDES)] + [3.0 * (n // len(SIDES)), 0.0]
        off.append((buffer.centroids + by).mean(axis=0) - place)
    return float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean()))


def test_recorded_poses_straighten_what_a_bent_map_has_displaced() -> None:
    bent = corrected_by(drawn_errors(8, 0.04), drawn_errors(3, 0.02))
    as_mapped = rms_error(bent, [np.zeros((len(one), 2)) for one in bent])
    assert rms_error(bent, landmark_moves(bent)) < 0.7 * as_mapped


def test_recorded_poses_do_not_disturb_what_a_straight_map_has_put_right() -> None:
    straight = corrected_by(np.zeros((8, 3)), drawn_errors(3, 0.04))
    assert rms_error(straight, landmark_moves(straight)) < 0.003


def test_things_without_company_stay_and_no_evidence_gives_no_moves() -> None:
    alone = buffers_of(drawn_errors(1, 0.04), cup_in=[])
    assert all(not moves.any() for moves in landmark_moves(alone))
    assert landmark_moves([]) == []


def test_frames_of_two_drives_with_the_same_stamps_are_not_one() -> None:
    errors = np.array([[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]] * 8)
    buffers = buffers_of(errors, cup_in=[0, 1])
    for buffer in buffers[1:]:
        buffer.items[:] = [
            dataclasses.replace(item, stamp=item.stamp // 2) for item in buffer.items
        ]
    buffers[0].items[:] = [dataclasses.replace(item, stamp=0.0) for item in buffers[0].items]
    one, other = landmark_moves(buffers)[0]
    assert one[0] < -0.03 < 0.03 < other[0]


def observations(errors: Array, cup_in: Sequence[int]) -> list[Observation]:
    found = []
    for i, error in enumerate(errors):
        shown = [thing for thing in range(len(SIDES)) if thing > 0 or i in cup_in]
        objects = tuple(
            ObservedObject(
                name=f"thing {thing}",
                score=0.9,
                footprint=shapely.Point(centroid(PLACES[thing], error)).buffer(SIDES[thing] / 2),
                z_max=0.5,
            )
            for thing in shown
        )
        found.append(Observation(float(i), pose(error), objects, EVERYWHERE))
    return found


def test_published_shapes_agree_and_those_in_between_do_not_wait_for_it() -> None:
    config = profile("default").evidence
    errors = drawn_errors(20, 0.02)
    landmarks = EvidenceMap(config)
    plain = EvidenceMap(dataclasses.replace(config, landmarks=False))
    for observation in observations(errors, cup_in=[16, 17, 18]):
        landmarks.update(observation)
        plain.update(observation)

    def off(evidence: EvidenceMap) -> float:
        (cup,) = [item for item in evidence.objects() if item.name == "thing 0"]
        return float(np.linalg.norm(np.array(cup.footprint.centroid.coords[0]) - PLACES[0]))

    assert off(landmarks) < 0.6 * off(plain)
    ids = [number for number, *_ in plain.summary()]
    assert [item.footprint for item in landmarks.objects(ids)] == [
        item.footprint for item in plain.objects(ids)
    ]
    between, final = landmarks.layer(is_final=False), landmarks.layer()
    assert [item.footprint for item in between] == [item.footprint for item in plain.objects()]
    assert [item.footprint for item in final] == [item.footprint for item in landmarks.objects()]


def cup_seen_twice() -> tuple[EvidenceConfig, list[Observation]]:
    """Return frames in which a cup becomes two tracks, and the settings for that."""
    errors = np.zeros((12, 3))
    errors[:6, 0], errors[6:, 0] = -0.05, 0.05
    config = dataclasses.replace(profile("default").evidence, align=0.0, class_sizes="any")
    return config, observations(errors, cup_in=range(12))


def test_a_cup_that_two_tracks_show_is_published_once_where_frames_agree() -> None:
    config, frames = cup_seen_twice()
    landmarks = EvidenceMap(config)
    plain = EvidenceMap(dataclasses.replace(config, landmarks=False))
    for observation in frames:
        landmarks.update(observation)
        plain.update(observation)
    assert (cups(plain.objects()), cups(landmarks.objects())) == (2, 1)
    # In between, what the final layer has left out stays so.
    assert cups(landmarks.layer(is_final=False)) == 2
    assert cups(landmarks.layer()) == cups(landmarks.layer(is_final=False)) == 1


def cups(objects: Iterable[SemanticObject]) -> int:
    return [item.name for item in objects].count("thing 0")


def test_what_the_final_layer_left_out_stays_so_after_corrected_poses_and_a_restart() -> None:
    evidence, frames = cup_seen_twice()
    keyframes = KeyframeConfig(min_distance=0)
    config = dataclasses.replace(profile("default"), keyframes=keyframes, evidence=evidence)
    mapper = Mapper(config, no_detections)
    shown = iter(frames)

    def perceive(_frame: RgbdFrame, _perceiver: Perceiver) -> Perceived:
        return Perceived(Detections.of([], []), 0, next(shown), None)

    mapper.perceive = perceive
    camera = Camera.from_intrinsics(10.0, 10.0, 3.5, 2.5, width=8, height=6)
    for one in frames:
        depth = np.full((6, 8), 1 + one.stamp / 20, np.float32)
        mapper.add(RgbdFrame(one.stamp, depth, camera, one.map_T_camera))
    assert cups(mapper.evidence.layer(is_final=False)) == 2
    restarted = Mapper.onto(mapper.hypermap(), no_detections)
    assert cups(restarted.evidence.layer(is_final=False)) == 1
    mapper.correct(trajectory_of(*mapper.logged_poses()))
    assert cups(mapper.evidence.layer(is_final=False)) == 1
