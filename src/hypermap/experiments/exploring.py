"""A simulated robot that chooses its own goals, and how fast a drive fills a map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from shapely import ops

from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import UNKNOWN
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import evaluate
from hypermap.exploration import Explorer, Frontier, NextView, Sensor
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.stages import OccupancyConfig
from hypermap.paths import NoPath, Path, PathSettings
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera
from hypermap.simulation import SimulatedRecording, World, ground_truth
from hypermap.simulation.render import DEFAULT_CAMERA
from hypermap.simulation.trajectory import DrivePlan, poses_at

_OFF_WALLS = 0.3  # meters more than its radius
_LONGEST_LEG = 3.0  # meters after which the robot chooses again, as it has seen more
_ON_THE_WAY = 3.0  # meters up to which it first looks at an unsure object
_FOUND = 0.25  # IoU of an object that is found
_SAME_PLACE = 0.3  # meters
_SAME_VIEW = math.radians(25)
_FULL_TURN = (0.0, 120.0, 240.0, 360.0)  # degrees

Goal = Frontier | NextView


@dataclass(frozen=True)
class Robot:
    """A robot that explores, and how long.

    Attributes:
        radius: of the robot [m].
        most_meters: it stops after so long a way, if nothing is left earlier [m].
        looks_at_objects: whether it also drives to where unsure objects are seen.
    """

    radius: float
    most_meters: float = 500.0
    looks_at_objects: bool = True

    @property
    def settings(self) -> PathSettings:
        """Where it can be; it keeps off walls where it can."""
        return PathSettings(self.radius, inflation_radius=self.radius + _OFF_WALLS)


@dataclass(frozen=True)
class Milestone:
    """What a map holds after a part of a drive.

    Attributes:
        meters: driven so far.
        seconds: that took.
        area: share of the floor on which the robot could drive that is known, 0..1.
        objects: share of the objects that are found at an IoU of 0.25, 0..1.
        precision: share of the map's objects that are right.
    """

    meters: float
    seconds: float
    area: float
    objects: float
    precision: float


@dataclass(frozen=True)
class Explored:
    """What became of a robot that chose its own way.

    Attributes:
        drive: the way, from where the world's drive begins.
        milestones: what its map held on the way, and at the end.
    """

    drive: DrivePlan
    milestones: tuple[Milestone, ...]


def explore(
    world: World,
    robot: Robot,
    config: MappingConfig,
    *,
    every: float = 10.0,
    rate: float = 2.0,
    seed: int = 0,
    camera: Camera = DEFAULT_CAMERA,
) -> Explored:
    """Let a robot choose its own way, from the start of the world's drive.

    It maps as it drives. First it turns around; then it drives to unsure objects that are near, to
    the best frontier, and at last to all other unsure objects, until nothing is left.

    Args:
        world: what there is, with a drive that gives start, speed and camera.
        robot: the robot.
        config: how it maps, from depth alone.
        every: meters from one milestone to the next.
        rate: frames per second.
        seed: of the errors of camera and detector; its poses are exact.
        camera: its RGB-D camera.

    Raises:
        ValueError: If the world has no drive.
    """
    if world.drive is None:
        raise ValueError(f"the world {world.name!r} has no drive, so there is no start")
    way = _Exploring(world, world.drive, robot, config, every, rate, seed, camera)
    way.run()
    drive = replace(world.drive, waypoints=tuple(way.waypoints))
    return Explored(drive, tuple(way.milestones))


def milestones(
    world: World,
    config: MappingConfig,
    *,
    every: float,
    radius: float,
    rate: float = 2.0,
    seed: int = 0,
    camera: Camera = DEFAULT_CAMERA,
) -> Iterator[Milestone]:
    """Yield what the map holds each time that so many meters of a world's drive are mapped.

    Args:
        world: what there is, with a drive.
        config: how it is mapped, from depth alone.
        every: meters from one to the next; the last one is at the end.
        radius: of the robot, whose floor counts [m].
        rate: frames per second.
        seed: of the errors of camera and detector; poses are exact.
        camera: the RGB-D camera.
    """
    judge = _Judge(world, radius)
    recording = SimulatedRecording(world, rate=rate, seed=seed, camera=camera, has_occupancy=False)
    mapper = Mapper(config, detections_from_recording())
    meters, due, before, stamp = 0.0, every, None, 0.0
    for frame in recording.frames():
        at, stamp = frame.map_T_camera[:2, 3], frame.stamp
        meters += 0.0 if before is None else math.dist(at, before)
        before = at
        if meters >= due:
            due += every
            yield judge.milestone(mapper, meters, stamp)
        mapper.add(frame)
    yield judge.milestone(mapper, meters, stamp)


class _Exploring:
    """A robot under way, with the map that it makes."""

    def __init__(
        self,
        world: World,
        drive: DrivePlan,
        robot: Robot,
        config: MappingConfig,
        every: float,
        rate: float,
        seed: int,
        camera: Camera,
    ) -> None:
        x, y, *look = drive.waypoints[0]
        self.waypoints: list[tuple[float, ...]] = [(x, y, *look) if look else (x, y, 0.0)]
        self._world, self._drive, self._robot = world, drive, robot
        self._rate, self._seed, self._camera = rate, seed, camera
        self._sensor = _sensor(drive, camera, config.occupancy)
        self._mapper = Mapper(config, detections_from_recording())
        self._pose = Pose2D(x, y, math.radians(self.waypoints[0][2]))
        self._meters, self._seconds = 0.0, 0.0
        self._judge = _Judge(world, robot.radius)
        self._every = every
        self.milestones: list[Milestone] = []
        self._seen: list[Pose2D] = []  # where it has looked at frontiers
        self._asked: set[tuple[str, int | None]] = set()  # objects that it has looked at

    def run(self) -> None:
        """Explore until nothing is left, or the way is as long as it may be."""
        start = math.degrees(self._pose.yaw)
        self._go([(self._pose.x, self._pose.y, start + turn) for turn in _FULL_TURN])
        due = self._every
        while self._meters < self._robot.most_meters and self._go_on():
            if self._meters >= due:
                due = self._meters + self._every
                self.milestones.append(self._milestone())
        self.milestones.append(self._milestone())

    def _milestone(self) -> Milestone:
        return self._judge.milestone(self._mapper, self._meters, self._seconds)

    def _go_on(self) -> bool:
        """Drive to the next goal, or some way toward it; return whether there was one."""
        # Around where a camera has started, it has not seen the floor.
        for settings in (self._robot.settings, replace(self._robot.settings, unknown_is_free=True)):
            here = [self._pose.x, self._pose.y]
            explorer = Explorer(self._mapper.hypermap(), here, settings, self._sensor)
            for goal in self._goals(explorer):
                try:
                    path = explorer.path_to(goal)
                except NoPath:
                    continue
                self._follow(path, goal)
                return True
        return False

    def _goals(self, explorer: Explorer) -> list[Goal]:
        views: list[NextView] = []
        if self._robot.looks_at_objects:
            views = [view for view in explorer.next_views() if _key(view) not in self._asked]
        near = [view for view in views if view.distance <= _ON_THE_WAY]
        borders = [each for each in explorer.frontiers() if not self._was_at(each.pose)]
        return [*near, *borders, *views]

    def _was_at(self, pose: Pose2D) -> bool:
        return any(
            math.hypot(pose.x - old.x, pose.y - old.y) < _SAME_PLACE
            and abs(math.remainder(pose.yaw - old.yaw, math.tau)) < _SAME_VIEW
            for old in self._seen
        )

    def _follow(self, path: Path, goal: Goal) -> None:
        """Drive to a goal; if it is far, a part of the way."""
        if path.length > 1.5 * _LONGEST_LEG:
            part = ops.substring(path.line, 0, _LONGEST_LEG)
            self._go([(x, y) for x, y in part.coords[1:]])
            return
        x, y, yaw = goal.pose.x, goal.pose.y, math.degrees(goal.pose.yaw)
        self._go([(*point,) for point in path.points_xy[1:-1].tolist()] + [(x, y, yaw)])
        if isinstance(goal, NextView):
            self._asked.add(_key(goal))
        else:
            self._seen.append(goal.pose)

    def _go(self, waypoints: list[tuple[float, ...]]) -> None:
        """Drive and map along waypoints (x, y) or (x, y, degrees)."""
        start = (self._pose.x, self._pose.y, math.degrees(self._pose.yaw))
        leg = replace(self._drive, waypoints=(start, *waypoints))
        recording = SimulatedRecording(
            replace(self._world, drive=leg),
            rate=self._rate,
            seed=self._seed + len(self.waypoints),
            camera=self._camera,
            has_occupancy=False,
        )
        for frame in recording.frames():
            self._mapper.add(replace(frame, stamp=self._seconds + frame.stamp))
        self._seconds += recording.info().duration + 1 / self._rate
        places = np.array([point[:2] for point in leg.waypoints])
        self._meters += float(np.hypot(*np.diff(places, axis=0).T).sum())
        self.waypoints += waypoints
        self._pose = _end_of(leg)


def _end_of(drive: DrivePlan) -> Pose2D:
    """Return where a drive ends."""
    x, y, yaw = poses_at(drive, np.array([math.inf]))[0].tolist()
    return Pose2D(x, y, yaw)


def _key(view: NextView) -> tuple[str, int | None]:
    return view.item.layer, view.item.object.id


def _sensor(drive: DrivePlan, camera: Camera, config: OccupancyConfig) -> Sensor:
    """Return what a camera sees of the floor."""
    steepest = math.radians(drive.pitch_deg) + math.atan(camera.height / 2 / camera.K[1, 1])
    nearest = (drive.camera_height - config.free_below) / math.tan(min(steepest, math.pi / 2))
    width = 2 * math.atan(camera.width / 2 / camera.K[0, 0])
    return Sensor(0.9 * config.max_range, max(0.0, nearest), math.degrees(width))


class _Judge:
    """Compares maps with the true one of a world."""

    def __init__(self, world: World, radius: float) -> None:
        assert world.drive is not None
        self._truth = ground_truth(world)
        start = world.drive.waypoints[0][:2]
        explorer = Explorer(self._truth, start, PathSettings(radius))
        reached = explorer.planner.distances(start)
        # Where the robot can get.
        rows, cols = np.nonzero(np.isfinite(reached.meters))
        self._floor_xy = reached.space.grid.centers(rows, cols)

    def milestone(self, mapper: Mapper, meters: float, seconds: float) -> Milestone:
        """Return what a map holds after so many meters and seconds."""
        hypermap = mapper.hypermap()
        known = hypermap.occupancy().value_at(self._floor_xy) != UNKNOWN
        found = evaluate(_objects(hypermap), _objects(self._truth), [_FOUND]).overall.detection[0]
        share = float(known.mean())
        return Milestone(meters, seconds, share, found.recall or 0.0, found.precision or 0.0)


def _objects(hypermap: Hypermap) -> list[SemanticObject]:
    return [item.object for item in hypermap.objects()]
