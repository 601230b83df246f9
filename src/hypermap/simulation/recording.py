"""A drive through a world as a recording, like one from a real camera."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray
from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.detections import Detections, Detector
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import OnBadFrame, PendingFrame, RecordingInfo, Stream
from hypermap.simulation.bad_frames import FAULTS, draw_fault
from hypermap.simulation.depth_noise import DepthNoise
from hypermap.simulation.detector import DetectorNoise, NoisyDetector
from hypermap.simulation.false_places import FalsePlace, detect_false_places, draw_false_places
from hypermap.simulation.lasting import LastingFaults
from hypermap.simulation.levels import Errors
from hypermap.simulation.map_noise import MapNoise
from hypermap.simulation.people import draw_walkers, walkers_at
from hypermap.simulation.pose_noise import PoseNoise
from hypermap.simulation.render import DEFAULT_CAMERA, Rendering
from hypermap.simulation.scene import Scene, size_of
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.trajectory import DrivePlan, camera_poses, planar_poses, poses_at
from hypermap.simulation.views import Views
from hypermap.simulation.world import World

# One stream of random numbers per kind of error, so that changing one leaves the others alone.
_DEPTH, _POSE, _DETECTOR, _FAULT = range(4)
_DARK, _MOUNT, _LASTING, _PLACES, _FALSE, _PEOPLE, _GLASS, _MAP = range(4, 12)

_PERSON = 1.75  # meters


class SimulatedRecording:
    """Fulfills `Recording`; frames are rendered on demand.

    The same arguments always give the same frames. A larger share of bad frames adds more of them,
    and does not change the good ones.

    Attributes:
        world: the scene.
        camera: the RGB-D camera.
        faults: the kind of fault of each bad frame, by the frame's number.
        sightings: how often each thing of the world was seen in the frames requested last, before
            faults.
        exact: of the frame requested last, without errors: the `map_T_camera`, shape (4, 4), and
            the depth [m], NaN where there is nothing, shape (H, W).
        true_poses: the exact `map_T_camera` of each frame, shape (N, 4, 4).
        recorded_poses: those that come with the frames, shape (N, 4, 4).
    """

    def __init__(
        self,
        world: World,
        *,
        camera: Camera = DEFAULT_CAMERA,
        rate: float = 3.0,
        depth_noise: DepthNoise | None = None,
        pose_noise: PoseNoise | None = None,
        detector: Detector | None = None,
        detector_noise: DetectorNoise | None = None,
        map_noise: MapNoise | None = None,
        people: int = 0,
        has_masks: bool = False,
        has_occupancy: bool = True,
        bad_frames: float = 0.0,
        seed: int = 0,
        renders_once: bool = False,
        start: float = 0.0,
    ) -> None:
        """Prepare a drive through a world.

        Args:
            world: what there is to see, with a drive.
            camera: the RGB-D camera.
            rate: frames per second.
            depth_noise: errors of the camera; None for a Kinect's.
            pose_noise: errors of the poses; None for none.
            detector: finds the objects in the color images, as `network_detector()` does; None for
                a simulated one, which adds errors to the truth.
            detector_noise: errors of the simulated one; None for the defaults.
            map_noise: errors of the occupancy map; None for none.
            people: number of people who walk through the world.
            has_masks: whether the simulated detector returns masks with its boxes.
            has_occupancy: whether the recording contains an occupancy map.
            bad_frames: share of the frames that broken sensors spoil, each by a fault of
                `bad_frames.FAULTS`.
            seed: of all random numbers.
            renders_once: whether rendered frames stay in memory, half a megabyte each, for the next
                iteration.
            start: the stamp of the first frame [s].

        Raises:
            ValueError: If the world has no drive, the rate is not positive, or `bad_frames` is
                not between 0 and 1.
        """
        if world.drive is None:
            raise ValueError(f"the world {world.name!r} has no drive, so there is no recording")
        if not 0 <= bad_frames <= 1:
            raise ValueError(f"bad_frames must be a share from 0 to 1, got {bad_frames}")
        self.world = world
        self.camera = camera
        self._depth_noise = depth_noise or DepthNoise()
        self._detector = detector
        self._detector_noise = detector_noise or DetectorNoise()
        self._map_noise = map_noise or MapNoise()
        self._seed = seed
        self._walkers = draw_walkers(people, world.drive, self._rng(_PEOPLE))
        self._has_masks = has_masks
        self._has_occupancy = has_occupancy
        self._renders_once = renders_once
        self._start = start
        self._rendered: list[RgbdFrame] | None = None
        self._stamps, poses = planar_poses(world.drive, rate)
        self.true_poses = camera_poses(poses, world.drive)
        self.recorded_poses = self._estimated(pose_noise or PoseNoise(), poses, world.drive)
        drawn = (draw_fault(bad_frames, self._rng(_FAULT, i)) for i in range(len(self)))
        self.sightings = Sightings.none(len(world.objects))
        self.exact = np.eye(4), np.full((camera.height, camera.width), np.nan, np.float32)
        self.faults = {i: fault for i, fault in enumerate(drawn) if fault is not None}

    @property
    def path(self) -> Path:
        """The name of the world, because there is no file."""
        return Path(self.world.name)

    @property
    def frame_id(self) -> str:
        """The frame of the world."""
        return "map"

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._stamps)

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:  # noqa: ARG002
        """Yield the frames in order of time, with color and detections."""
        if not self._renders_once:
            return self._arriving()
        if self._rendered is None:
            self._rendered = list(self._arriving())
        return iter(self._rendered)

    def pending(self, on_bad: OnBadFrame | None = None) -> Iterator[PendingFrame]:
        """Yield what `frames` yields, so that it can be used like a recording of files."""
        for frame in self.frames(on_bad):
            yield PendingFrame(frame.stamp, frame.map_T_camera, partial(copy, frame))

    def _arriving(self) -> Iterator[RgbdFrame]:
        """Yield the frames that arrive, good or bad."""
        before = None
        for i, frame in enumerate(self._good_frames()):
            arrived: RgbdFrame | None = frame
            if (fault := self.faults.get(i)) is not None:
                rng = self._rng(_FAULT, i, 1)
                arrived = FAULTS[fault](frame, before or frame, rng)
            if arrived is not None:
                yield arrived
            before = frame

    @classmethod
    def with_errors(cls, world: World, errors: Errors, **options: Any) -> SimulatedRecording:
        """Prepare a drive with all of some errors, as those of a level; options as above."""
        return cls(
            world,
            depth_noise=errors.depth,
            pose_noise=errors.poses,
            detector_noise=errors.detector,
            map_noise=errors.map,
            people=errors.people,
            **options,
        )

    def _good_frames(self) -> Iterator[RgbdFrame]:
        views = Views(self.world, self.camera)
        dark = self._depth_noise.draw_dark(len(self.world.objects), self._rng(_DARK))
        noisy, places = self._noisy_detector(), self._false_places(views)
        names = [thing.label for thing in self.world.objects]
        self.sightings = Sightings.none(len(names))
        for i, stamp in enumerate(self._stamps.tolist()):
            pose = self.true_poses[i]
            moving = self._people_at(stamp, pose)
            view = views.seen(pose, moving)
            measured = views.measured(
                view, pose, moving, self._depth_noise.glass_return, self._rng(_GLASS, i)
            )
            if self._detector is not None:
                detections = self._detector.detect(view.color)
            else:
                detections = noisy.detect(view.instances, self._seen_falsely(places, view, i))
            self.sightings.add(view.instances, view.depth, detections, names)
            self.exact = pose, view.depth
            yield RgbdFrame(
                stamp=self._start + stamp,
                depth=self._depth_noise.measure(measured, self._rng(_DEPTH, i), dark),
                camera=self.camera,
                map_T_camera=self.recorded_poses[i],
                color=view.color,
                color_stamp=self._start + stamp,
                detections=detections,
            )

    def _noisy_detector(self) -> NoisyDetector:
        noise = self._detector_noise
        names = [thing.label for thing in self.world.objects] + ["person"] * len(self._walkers)
        sizes = [size_of(thing) for thing in self.world.objects] + [_PERSON] * len(self._walkers)
        lasting = LastingFaults.draw(names, np.array(sizes), noise, self._rng(_LASTING))
        return NoisyDetector(names, noise, self._rng(_DETECTOR), self._has_masks, lasting)

    def _false_places(self, views: Views) -> list[FalsePlace]:
        names = sorted({thing.label for thing in self.world.objects})
        count, rng = self._detector_noise.false_places, self._rng(_PLACES)
        return draw_false_places(count, self.true_poses, views.seen, self.camera, names, rng)

    def _seen_falsely(self, places: list[FalsePlace], view: Rendering, i: int) -> Detections | None:
        if not places:
            return None
        rate, rng = self._detector_noise.false_place_rate, self._rng(_FALSE, i)
        return detect_false_places(places, self.true_poses[i], view, self.camera, rate, rng)

    def _people_at(self, stamp: float, pose: FloatArray) -> Scene | None:
        """Return the people in the world at a time; None for none."""
        first = len(self.world.objects)
        here = walkers_at(self._walkers, stamp, pose[:2, 3])
        return Scene.of_things((first + n, one) for n, one in here) if here else None

    def info(self) -> RecordingInfo:
        """Say what is inside."""
        n = len(self)
        streams = [
            Stream("depth", "simulated depth images", n, "geometry"),
            Stream("color", "simulated color images", n, "detection of objects"),
            Stream("detections", "simulated detections", n, "names and boxes of objects"),
            Stream("poses", "simulated camera poses", n, "where each image was taken"),
        ]
        if self._has_occupancy:
            streams.append(Stream("map", "occupancy map", 1, "occupancy layer"))
        return RecordingInfo(
            path=self.path,
            format="simulation",
            duration=float(self._stamps[-1] - self._stamps[0]),
            frames=n,
            image_size=(self.camera.width, self.camera.height),
            streams=tuple(streams),
        )

    def occupancy(self) -> OccupancyLayer | None:
        """Return the occupancy map of walls and objects, or None if there is to be none."""
        return self._map_noise.make(self.world, self._rng(_MAP)) if self._has_occupancy else None

    def _estimated(
        self, noise: PoseNoise, poses: NDArray[np.float64], drive: DrivePlan
    ) -> NDArray[np.float64]:
        """Return `map_T_camera` of all frames as localization reports it, shape (N, 4, 4)."""
        if noise.time_offset:
            poses = poses_at(drive, self._stamps - noise.time_offset)
        estimated = noise.estimate(self._stamps, poses, self._rng(_POSE))
        cameras = camera_poses(estimated, drive)
        if noise.mounting_deg or noise.mounting:
            cameras = cameras @ noise.mounting_error(self._rng(_MOUNT))
        return cameras

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, *stream])
