"""The map that a live node makes, guarded against its threads."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.trajectory import Trajectory
from hypermap.formats import open_map
from hypermap.mapping.config import MappingConfig, chosen_config
from hypermap.mapping.correcting import Correction
from hypermap.mapping.edited_copy import take_edits
from hypermap.mapping.going_on import CannotGoOn, config_to_go_on_with, replaced
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.same_place import PlaceCheck
from hypermap.mapping.usable import why_unusable
from hypermap.perception.detections import Detections
from hypermap.perception.detectors import load_detector, sources
from hypermap.perception.frame import Camera, DetectionSource, RgbdFrame
from hypermap.perception.observation import Observation
from hypermap.ros.mapper.measured_layers import MeasuredLayers
from hypermap.ros.mapper.saved_files import SavedFiles
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.mapper.statistics import Fate

_DRIVE = "live"  # the name of what is mapped here


class LiveMap:
    """Frames in, maps out; each call sees whole frames.

    Attributes:
        config: how mapping is done.
        revision: grows with every change by frames.
        values: the layers of what other sensors measure.
        files: those of the node, and whether others have changed them.
        saves: how often the node has saved it, since it last took over what others have edited.
    """

    def __init__(self, settings: LiveSettings) -> None:
        """Load what mapping needs.

        Raises:
            HypermapError: If the configuration, the detector, the detections or the map to go on
                with cannot be read, or mapping cannot go on with it.
        """
        self.files = SavedFiles([settings.onto, settings.save_to])
        onto = _map_to_go_on_with(settings)
        self.config = _config(settings, onto)
        self.revision = 0
        self.saves = 0
        self._frame_id = settings.map_frame.strip("/")
        self._makes_occupancy = settings.occupancy and not settings.map_topic
        self._given: OccupancyLayer | None = None
        self._lock = threading.Lock()
        self._source = _beside_others(_source(settings, self.config), self._lock)
        self.values = MeasuredLayers(self._frame_id, onto)
        self._mapper = self._new_mapper() if onto is None else self._going_on(settings, onto)
        if onto is not None:
            self.files.know(onto)

    def warm_up(self) -> None:
        """Map something made up and forget it: the first frame then takes no longer than others.

        Compiled code is loaded, which takes a second, or half a minute the first time ever.
        """
        camera = Camera.from_intrinsics(60.0, 60.0, 31.5, 23.5, 64, 48)
        depth = np.full((48, 64), 2.0, np.float32)
        depth[16:32, 24:40] = 1.0
        pose = np.diag([1.0, -1.0, -1.0, 1.0])  # looks down from 2 m
        pose[2, 3] = 2.0
        seen = Detections.of([[20, 12, 44, 36]], ["box"])
        mapper = Mapper(self.config, lambda _: seen, frame_id=self._frame_id)
        mapper.add(RgbdFrame(0.0, depth, camera, pose))
        mapper.hypermap()

    def add(self, frame: RgbdFrame) -> tuple[Fate, str, Observation | None]:
        """Map a frame.

        Returns:
            What became of it, why if it is unusable, and what it shows if it was mapped. Of one
            frame that was mapped, it is told if the robot seems to be in another place than that
            of the map that is continued.

        Raises:
            HypermapError: If nothing can say what the frame shows; the map stays as it was.
        """
        if (reason := why_unusable(frame)) is not None:
            return Fate.UNUSABLE, reason, None
        with self._lock:
            mapper = self._mapper  # which `clear` may replace while the detector looks
            before = mapper.counts
            observation = mapper.add(frame)
            if observation is not None:
                self.revision += 1
                return Fate.MAPPED, _doubt(mapper), observation
            if mapper.counts.skipped > before.skipped:
                return Fate.STILL, "", None
            if mapper.counts.repeated > before.repeated:
                return Fate.REPEATED, "", None
        return Fate.UNUSABLE, "it is too far away", None

    def walls(self) -> OccupancyLayer:
        """Return the occupancy layer so far."""
        with self._lock:
            return self._mapper.occupancy() if self._given is None else self._given

    @property
    def state(self) -> tuple[int, ...]:
        """What differs after every change, by frames or samples."""
        return self.revision, *self.values.revisions

    @property
    def is_new(self) -> bool:
        """Whether frames or samples have come, beyond those of earlier runs."""
        return self.frames > 0 or self.values.are_new

    def give_occupancy(self, layer: OccupancyLayer) -> None:
        """Take the occupancy layer of another node, and correct poses by it from now on."""
        with self._lock:
            self._given = layer
            self._mapper.correct_poses_by(layer)
            self.revision += 1

    def logged_poses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stamps and poses of the frames that can be corrected, as `Mapper` does."""
        with self._lock:
            return self._mapper.logged_poses()

    def correct(self, trajectory: Trajectory, least: float) -> Correction | None:
        """Correct the poses of the frames as `Mapper.correct` does, those after its end, too.

        Frames wait meanwhile.

        Args:
            trajectory: of the camera in the map.
            least: how far a frame must move for the map to change [m].

        Returns:
            What became of the poses; None if no frame moves that far.

        Raises:
            CannotCorrect: If the trajectory is of none of the frames.
        """
        with self._lock:
            correction = self._mapper.correct(trajectory, is_under_way=True, least=least)
            if correction is not None:
                self.revision += 1
                self.values.move(correction.motions().moved)
            return correction

    def take_edits(self, edited: Hypermap) -> None:
        """Go on with what people have changed in a copy of the map, as `edited_copy` does.

        Frames wait meanwhile.

        Raises:
            CannotGoOn: If mapping cannot go on with the copy.
        """
        with self._lock:
            take_edits(self._mapper, edited)
            self.saves = 0
            self.revision += 1

    @property
    def corrects_poses(self) -> bool:
        """Whether frames are put where they fit the occupancy map, whatever tf says of them."""
        return self._mapper.corrects_poses

    def clear(self) -> None:
        """Forget all frames, and the map with which mapping went on."""
        with self._lock:
            self._mapper = self._new_mapper()
            self.files.forget()
            self.values.clear()
            self.revision += 1

    @property
    def frames(self) -> int:
        """How many frames were mapped, without those of earlier runs."""
        return self._mapper.counts.used

    @property
    def repeated(self) -> int:
        """How many frames were not mapped, as the map that is continued has them already."""
        return self._mapper.counts.repeated

    def __len__(self) -> int:
        """Return how many objects there are."""
        with self._lock:
            return len(self._mapper.evidence)

    def semantic(self) -> SemanticLayer:
        """Return the objects as they are between two frames, before they become landmarks."""
        with self._lock:
            return self._mapper.evidence.layer(frame_id=self._frame_id, is_final=False)

    def mapped(self) -> tuple[SemanticLayer, OccupancyLayer | None]:
        """Return objects, and cells seen by the camera, at one moment between two frames.

        Returns:
            No cells if the occupancy layer comes from elsewhere.
        """
        with self._lock:
            objects = self._mapper.evidence.layer(frame_id=self._frame_id, is_final=False)
            is_own = self._given is None and self._mapper.makes_occupancy
            return objects, self._mapper.occupancy() if is_own else None

    def hypermap(self) -> Hypermap:
        """Return the map so far: an occupancy layer, unless there is to be none, and objects.

        Then come the layers of measured values. A map with which mapping went on keeps its others.
        """
        with self._lock:
            mapper, given = self._mapper, self._given
            whole = mapper.hypermap()
        if given is not None:
            whole = whole.with_layers(replaced(whole, [given]))
        elif not mapper.makes_occupancy and mapper.occupancy().grid is None:
            whole.remove(mapper.occupancy().name)
        return self.values.added_to(whole)

    def _new_mapper(self) -> Mapper:
        none = None if self._makes_occupancy else OccupancyLayer("occupancy", self._frame_id)
        mapper = Mapper(self.config, self._source, none, self._frame_id, _DRIVE)
        if self._given is not None:
            mapper.correct_poses_by(self._given)
        return mapper

    def _going_on(self, settings: LiveSettings, onto: Hypermap) -> Mapper:
        try:
            mapper = Mapper.onto(onto, self._source, self.config, _DRIVE, self._frame_id)
        except CannotGoOn as error:
            raise HypermapError(f"onto: {settings.onto}: {error}") from error
        if mapper.makes_occupancy and settings.map_topic:
            raise HypermapError(
                f"onto: {settings.onto}: its occupancy layer was made from depth; "
                "leave out map_topic"
            )
        self._makes_occupancy = mapper.makes_occupancy
        cameras_xy = mapper.logged_poses()[1][:, :2, 3]
        layer = mapper.occupancy().name
        mapper.place = PlaceCheck(onto, mapper.config.occupancy, layer, cameras_xy)
        return mapper


def _doubt(mapper: Mapper) -> str:
    """Return once what tells that the robot is in another place than that of its map."""
    finding = "" if mapper.place is None else mapper.place.finding("what the robot sees")
    if not finding:
        return ""
    mapper.place = None
    return (
        f"{finding} Then mapping spoils the map: stop, take the one that was kept (.bak), map to a "
        "file of its own, and join the two by `hypermap merge`"
    )


def _map_to_go_on_with(settings: LiveSettings) -> Hypermap | None:
    """Return the map `onto`; None if none is given, or it is yet to be saved by this very node."""
    if not settings.onto or (
        settings.onto == settings.save_to and not Path(settings.onto).exists()
    ):
        return None
    try:
        return open_map(settings.onto)
    except HypermapError as error:
        raise HypermapError(f"onto: {error}") from error


def _config(settings: LiveSettings, onto: Hypermap | None) -> MappingConfig:
    score = None if settings.score < 0 else settings.score
    has_network = bool(settings.detector)
    name = None if settings.profile == "default" else settings.profile  # `config` may name another
    asked = chosen_config(name, settings.config or None, score, has_network)
    if onto is None:
        return asked
    is_asked = not settings.origins.keys().isdisjoint(("profile", "config", "score"))
    try:
        return config_to_go_on_with(onto, asked if is_asked else None)
    except CannotGoOn as error:
        raise HypermapError(f"onto: {settings.onto}: {error}") from error


def _beside_others(source: DetectionSource, lock: threading.Lock) -> DetectionSource:
    """Return a source that lets others at the map while it looks, which may take seconds."""

    def look(frame: RgbdFrame) -> Detections:
        lock.release()
        try:
            return source(frame)
        finally:
            lock.acquire()

    return look


def _source(settings: LiveSettings, config: MappingConfig) -> DetectionSource:
    if settings.detector:
        score = config.perception.min_score
        threads = settings.detector_threads or None
        detector = load_detector(settings.detector, settings.labels or None, score, threads=threads)
        return sources.detections_from_detector(detector)
    if settings.detections_file:
        return sources.detections_from_file(settings.detections_file)
    return sources.detections_from_recording()
