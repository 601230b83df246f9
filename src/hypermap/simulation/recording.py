"""A drive through a world as a recording, like one from a real camera."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.detections import Detector
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import OnBadFrame, RecordingInfo, Stream
from hypermap.simulation.bad_frames import FAULTS, draw_fault
from hypermap.simulation.detector import DetectorNoise, NoisyDetector
from hypermap.simulation.noise import DepthNoise, PoseNoise
from hypermap.simulation.render import DEFAULT_CAMERA, Renderer
from hypermap.simulation.scene import Scene
from hypermap.simulation.trajectory import camera_poses, planar_poses
from hypermap.simulation.truth import true_occupancy
from hypermap.simulation.world import World

# One stream of random numbers per kind of error, so that changing one leaves the others alone.
_DEPTH, _POSE, _DETECTOR, _FAULT = range(4)


class SimulatedRecording:
    """Fulfills `Recording`; frames are rendered when they are asked for.

    The same arguments give the same frames, each time that they are asked for. A larger share of
    bad frames spoils more of them, and leaves those that stay good as they were.

    Attributes:
        world: what there is to see.
        camera: the RGB-D camera.
        faults: the kind of fault of each bad frame, by the frame's number.
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
        has_masks: bool = False,
        has_occupancy: bool = True,
        bad_frames: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Prepare a drive through a world.

        Args:
            world: what there is to see, with a drive.
            camera: the RGB-D camera.
            rate: frames per second.
            depth_noise: errors of the camera; None for a Kinect's.
            pose_noise: errors of the poses; None for none.
            detector: finds the objects in the color images, as `network_detector()` does; None for
                one that knows where they are, and errs.
            detector_noise: how that one errs; None for the defaults.
            has_masks: whether that one gives masks with its boxes.
            has_occupancy: whether the recording comes with the exact occupancy map.
            bad_frames: share of the frames that broken sensors spoil, each by a fault of
                `bad_frames.FAULTS`.
            seed: of all random numbers.

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
        self._has_masks = has_masks
        self._has_occupancy = has_occupancy
        self._seed = seed
        self._stamps, poses = planar_poses(world.drive, rate)
        self._true_poses = camera_poses(poses, world.drive)
        estimated = (pose_noise or PoseNoise()).estimate(self._stamps, poses, self._rng(_POSE))
        self._estimated_poses = camera_poses(estimated, world.drive)
        drawn = (draw_fault(bad_frames, self._rng(_FAULT, i)) for i in range(len(self)))
        self.faults = {i: fault for i, fault in enumerate(drawn) if fault is not None}

    @property
    def path(self) -> Path:
        """The name of the world; there is no file."""
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
        before = None
        for i, frame in enumerate(self._good_frames()):
            arrived: RgbdFrame | None = frame
            if (fault := self.faults.get(i)) is not None:
                rng = self._rng(_FAULT, i, 1)
                arrived = FAULTS[fault](frame, before or frame, rng)
            if arrived is not None:
                yield arrived
            before = frame

    def _good_frames(self) -> Iterator[RgbdFrame]:
        renderer = Renderer(Scene.of(self.world), self.camera)
        names = [thing.label for thing in self.world.objects]
        noisy = NoisyDetector(names, self._detector_noise, self._rng(_DETECTOR), self._has_masks)
        for i, stamp in enumerate(self._stamps.tolist()):
            view = renderer.render(self._true_poses[i])
            yield RgbdFrame(
                stamp=stamp,
                depth=self._depth_noise.measure(view, self._rng(_DEPTH, i)),
                camera=self.camera,
                map_T_camera=self._estimated_poses[i],
                color=view.color,
                color_stamp=stamp,
                detections=(
                    self._detector.detect(view.color)
                    if self._detector is not None
                    else noisy.detect(view.instances)
                ),
            )

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
            streams.append(Stream("map", "exact occupancy map", 1, "occupancy layer"))
        return RecordingInfo(
            path=self.path,
            format="simulation",
            duration=float(self._stamps[-1] - self._stamps[0]),
            frames=n,
            image_size=(self.camera.width, self.camera.height),
            streams=tuple(streams),
        )

    def occupancy(self) -> OccupancyLayer | None:
        """Return the exact occupancy map of walls and objects, or None if there is to be none."""
        return true_occupancy(self.world) if self._has_occupancy else None

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, *stream])
