"""A map with all that mapping and people leave: to be saved, spoiled and asked."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from datetime import datetime, timezone
from functools import cache

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.samples import Samples
from hypermap.core.trajectory import Trajectory, trajectory_of
from hypermap.core.value_layer import ValueLayer
from hypermap.formats.hmap import files_of_map, map_of_files
from hypermap.history import grown
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.notes import Note, add_note, attachment_of_bytes
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.embedders.embedder import unit_vectors
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world, errors_of_level
from hypermap.simulation.render import DEFAULT_CAMERA
from hypermap.testing import jpeg_picture

MONDAY = 1.7e9  # s since 1970
ATTACHED = b"%PDF-1.4 what the lift's plate says\n" * 20  # of the shortest file; one more a note
_FRAMES = 24  # by which two objects are known


class MeanColors:
    """An encoder that knows images by their mean colors, and texts by their first letters."""

    model = "mean colors"

    def images(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return a unit vector for each RGB image, shape (N, 3)."""
        means = [image.reshape(-1, 3).mean(axis=0) + 1 for image in images]
        return unit_vectors(np.array(means, np.float32).reshape(-1, 3))

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        """Return a unit vector for each text, shape (N, 3)."""
        letters = [[ord(c) for c in text[:3].ljust(3)] for text in texts]
        return unit_vectors(np.array(letters, np.float32).reshape(-1, 3))


def colored_drive(seed: int, rate: float, every: int = 4) -> list[RgbdFrame]:
    """Return small frames of a drive through a room, with their color.

    Args:
        seed: of its errors.
        rate: of the frames [Hz].
        every: which rows and columns of an image there are.
    """
    errors = errors_of_level("robot")
    recording = SimulatedRecording(
        demo_world(),
        camera=DEFAULT_CAMERA.every(every),
        rate=rate,
        depth_noise=errors.depth,
        pose_noise=errors.poses,
        detector_noise=errors.detector,
        seed=seed,
    )
    return [dataclasses.replace(frame, color=frame.color) for frame in recording.frames()]


@cache
def _mapped(begins: float) -> tuple[Hypermap, Trajectory]:
    config = profile("default")
    coarse = dataclasses.replace(config.occupancy, resolution=0.25)
    mapper = Mapper(dataclasses.replace(config, occupancy=coarse), detections_from_recording())
    mapper.embed_with(MeanColors())
    frames = colored_drive(7, 1.0, 8)[:_FRAMES]
    for frame in frames:
        mapper.add(dataclasses.replace(frame, stamp=begins + frame.stamp))
    stamps, poses = mapper.logged_poses()
    poses[:, 0, 3] += 0.05
    return mapper.hypermap(), trajectory_of(stamps, poses)


def full_map(version: int = 0, begins: float = MONDAY) -> Hypermap:
    """Return the first or the second version of the map, which differ in each of its parts.

    Maps whose drives begin at other times [s] show other drives.

    It has a mapper's state with a log of frames, pictures and embeddings of objects, a history of
    two versions, a layer of measured values with their samples, and notes with files.
    """
    hypermap = map_of_files(files_of_map(_mapped(begins)[0]), "the mapped drive")
    layer = hypermap.semantic()
    number = int(layer.ids[version])
    layer.kept_pictures = {**layer.kept_pictures, number: (jpeg_picture("red", quality=0.9),)}
    layer.rename(number, f"changed {version}")
    hypermap = grown(hypermap, begins + 100 + version)
    warmth = ValueLayer(
        "warmth",
        "map",
        GridGeometry(3, 2, 0.5),
        [[19.5, 20, 21 + version], [22, np.nan, 18]],
        "°C",
        deviations=np.ones((2, 3)),
        samples=Samples.of([[0.2, 0.3], [1, 0.5]], [19.6, 22 + version], [False, True]),
        made_by={"method": "gmrf", "length": 2.5},
    )
    hypermap = hypermap.with_layers([*hypermap, warmth])
    for number in range(2 + version):
        attached = [attachment_of_bytes(ATTACHED + b"." * n, f"plate {n}.pdf") for n in (0, number)]
        add_note(
            hypermap,
            Note(
                shapely.box(0, 0, 1 + number, 1) if number else shapely.Point(1, 2),
                f"# Loose tile {number}\nSee [there](https://example.org).",
                "Ada",
                datetime.fromtimestamp(begins + number, timezone.utc),
                tuple(attached if number else attached[:1]),
                ("https://example.org/a",),
            ),
        )
    return hypermap


def corrected_trajectory() -> Trajectory:
    """Return better poses for the frames of the map."""
    return _mapped(MONDAY)[1]
