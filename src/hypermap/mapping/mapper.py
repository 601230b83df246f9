"""Mapping: frames become a hypermap of an occupancy and a semantic layer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.history import History, Mapped
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.core.trajectory import Trajectory
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.correcting import Correction, can_be_corrected, corrected_poses, map_again
from hypermap.mapping.counts import Counts
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.floor_motions import PoseChanges
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, MapBefore, packed_frame
from hypermap.mapping.going_on import (
    CannotGoOn,
    config_to_go_on_with,
    edits_of,
    layer_of_objects,
    replaced,
    state_of,
)
from hypermap.mapping.intake import FrameIntake
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.looks import embed_objects
from hypermap.mapping.map_metadata import made_metadata
from hypermap.mapping.mapper_state import MapperState, dump_state
from hypermap.mapping.observed_colors import with_colors
from hypermap.mapping.occupancy import OccupancyMapper
from hypermap.mapping.perceived import Perceived, Perceiver, no_detections
from hypermap.mapping.pictures import keep_pictures
from hypermap.mapping.same_place import PlaceCheck
from hypermap.mapping.sample_places import with_moved_samples
from hypermap.mapping.second_look import doubt_about_changes
from hypermap.mapping.shifts import Shifts
from hypermap.perception.detections import Detections
from hypermap.perception.embedders.embedder import Embedder
from hypermap.perception.frame import DetectionSource, RgbdFrame
from hypermap.perception.observation import Observation

_OCCUPANCY = "occupancy"


Perceive: TypeAlias = "Callable[[RgbdFrame, Perceiver], Perceived]"


class BadFrame(HypermapError):
    """A frame cannot be mapped; others may be."""


@dataclass(frozen=True, eq=False)
class MappedFrame:
    """A mapped frame, for observers.

    Attributes:
        frame: the frame, with its corrected pose.
        detections: those above the score threshold of the configuration.
        observation: the footprints on the floor. Its objects contain their segments, which refer
            to the detections.
    """

    frame: RgbdFrame
    detections: Detections
    observation: Observation


class Mapper:
    """Turns frames into a map, one by one; `hypermap` may be called at any time.

    Attributes:
        config: the settings.
        evidence: the objects and the evidence for them.
        intake: which frames of the drive are mapped; counts them, and tells of the others.
        watch: called after each mapped frame; None for no observer.
        embedder: encodes what frames show of objects; None to only keep earlier embeddings. Set it
            by `embed_with`.
        perceive: returns what a single frame shows, given the perceiver; may look up results that
            were computed before.
        place: told of each mapped frame, to find out whether it shows the place of the map; None
            to leave that out.
        pose_changes: told how the pose of each mapped frame was corrected; None for nobody.
    """

    def __init__(
        self,
        config: MappingConfig,
        source: DetectionSource | None,
        occupancy: OccupancyLayer | None = None,
        frame_id: str = "map",
        drive: str = "",
    ) -> None:
        """Prepare an empty map; `onto` continues one.

        Args:
            config: the settings.
            source: returns the detections of a frame; None for a map without objects.
            occupancy: the first layer of the map, if it is known; otherwise it is made from depth.
                The frames' poses must be in its frame, and are corrected by it.
            frame_id: coordinate frame of the poses and of the layers; not used if `occupancy` is
                given.
            drive: name of the recording.
        """
        self.config = config
        is_free = None if occupancy is None else partial(free_share, occupancy)
        self.evidence = EvidenceMap(config.evidence, is_free)
        self.watch: Callable[[MappedFrame, Mapper], None] | None = None
        self.embedder: Embedder | None = None
        self.perceive: Perceive = _perceive_now
        self.place: PlaceCheck | None = None
        self.pose_changes: PoseChanges | None = None
        self._source = source or no_detections
        self._has_objects = self._looks_for_objects = source is not None
        self.intake = FrameIntake(config.keyframes, drive)
        self._given_occupancy = occupancy
        self._aligner = None if occupancy is None else Aligner(occupancy, config.alignment)
        self._frame_id = frame_id
        self._occupancy = OccupancyMapper(config.occupancy)
        self._base = Hypermap()  # the map that this one continues
        self._frame_log = FrameLog()
        self._shifts = Shifts(None)

    @classmethod
    def onto(
        cls,
        hypermap: Hypermap,
        source: DetectionSource | None,
        config: MappingConfig | None = None,
        drive: str = "",
        frame_id: str | None = None,
    ) -> Mapper:
        """Continue a map, exactly as if mapping had never stopped.

        The poses must be in the map's base frame. Frames that the map already contains are left
        out. Other layers of the map, its transforms and its metadata stay.

        Args:
            hypermap: a map made by mapping; not changed.
            source: returns the detections of a frame; None leaves the objects unchanged.
            config: must be that of the map; None takes it from the map.
            drive: name of the recording.
            frame_id: coordinate frame of the poses, if it is known.

        Raises:
            CannotGoOn: If mapping did not make the map, or with another configuration or in another
                frame, or the mapper state is not in it.
        """
        own_config = config_to_go_on_with(hypermap, config)
        if frame_id is not None and frame_id != hypermap.base_frame:
            raise CannotGoOn(
                f"the poses are in the frame {frame_id!r}, and the map in {hypermap.base_frame!r}; "
                "mapping can only continue a map in its own frame; if the poses are in that one, "
                f"too, give --map-frame {hypermap.base_frame}, or, where tf has another name for "
                "it, --same-place to `hypermap map`; `live` needs a static transform between both"
            )
        state = state_of(hypermap, own_config)
        occupancy = None
        if state.log_odds is None:
            grids = (layer for layer in hypermap if isinstance(layer, OccupancyLayer))
            occupancy = next(grids, OccupancyLayer(_OCCUPANCY, hypermap.base_frame))
        mapper = cls(own_config, source, occupancy, hypermap.base_frame, drive)
        mapper._go_on_with(hypermap, state)
        return mapper

    def _go_on_with(self, hypermap: Hypermap, state: MapperState) -> None:
        """Begin with a map and the state in which mapping left it."""
        self._base, self._shifts = hypermap, Shifts(hypermap.history)
        self._has_objects = self._has_objects or layer_of_objects(hypermap) is not None
        edits = edits_of(hypermap, state, self.config.evidence)
        self.evidence.go_on_with(state.tracks, edits)
        published = {item.id for item in state.published}
        self.evidence.left_out = {n for n, *_ in self.evidence.summary()} - published
        self.intake.go_on_after(state.drives, state.keyframe, state.counts)
        if state.log_odds is not None:
            self._occupancy.go_on_with(state.first_cell, state.log_odds)
        if self._aligner is not None and state.alignment is not None:
            self._aligner.go_on_with(*state.alignment)
        self._frame_log = FrameLog(state.log)
        if state.drives and state.drives[-1].name != self.intake.drive.name:
            self._frame_log.end_drive()

    def go_on_in(self, hypermap: Hypermap, log: FrameLog) -> None:
        """Keep the other layers, transforms, metadata and history of another map from now on.

        Args:
            hypermap: this mapper's own map, as others have changed it.
            log: the frames of that map.
        """
        self._base, self._shifts = hypermap, Shifts(hypermap.history)
        self._shifts.add(log, self._frame_log, self.intake.drives())

    def embed_with(self, embedder: Embedder | None) -> None:
        """Embed the objects in later frames; None to stop.

        Raises:
            CannotGoOn: If the map has embeddings of another embedder.
        """
        before = self.evidence.embedding_model()
        if embedder is not None and before not in (None, embedder.model):
            raise CannotGoOn(
                f"the objects of the map were embedded by {before!r}, not by {embedder.model!r}; "
                "embeddings of different encoders cannot be compared"
            )
        self.embedder = embedder

    def add(self, frame: RgbdFrame) -> Observation | None:
        """Map one frame.

        Returns:
            What the frame shows; None if the frame is unusable, which is logged, or was skipped
            because its camera has hardly moved; see `counts`.

        Raises:
            BadFrame: If the source of detections fails, or the color cannot be read; the map stays
                unchanged.
        """
        if not self.intake.is_wanted(frame):
            return None
        aligned = frame if self._aligner is None else self._aligner.align(frame)
        try:
            perceived = self.perceive(aligned, self.perceiver)
        except HypermapError as error:
            self.keyframes.undo()
            raise BadFrame(str(error)) from error
        if aligned is not frame:
            perceived = perceived.corrected_from(frame.map_T_camera)
        perceived = perceived.at(frame.stamp + self.intake.offset_of(frame))
        self.intake.count_surplus(frame.stamp, perceived.surplus, len(perceived.detections))
        if self._frame_log.is_full:
            self._frame_log.begin_part(self._map_before())
        if not self._fuse(frame.stamp, perceived):
            return None
        self.intake.was_mapped(frame)
        if self.place is not None:
            self.place.add(aligned, perceived)
        if self.pose_changes is not None:
            self.pose_changes.add(frame.stamp, frame.map_T_camera, aligned.map_T_camera)
        observation = perceived.observation
        if self.config.evidence.moves:  # nothing else compares colors
            observation = with_colors(aligned, observation, self.evidence)
        logged = LoggedFrame(observation, perceived.cells, self._looks_for_objects)
        self._frame_log.add(frame.stamp, packed_frame(logged), aligned.map_T_camera)
        self._keep_looks(aligned, perceived.detections)
        if self.watch is not None:
            self.watch(MappedFrame(aligned, perceived.detections, perceived.observation), self)
        return perceived.observation

    def _fuse(self, stamp: float, perceived: Perceived) -> bool:
        """Add what a frame shows to both layers, or to none; return whether it was possible."""
        change: Callable[[], None] | None = None
        if self.makes_occupancy:
            try:
                change = self._occupancy.change_by(perceived.cells)
            except HypermapError as error:  # one bad pose must not end an hour of mapping
                self.keyframes.undo()
                self.intake.leave_out(stamp, str(error))
                return False
        if self._looks_for_objects:  # otherwise nothing that is not found would be missing
            self.evidence.update(perceived.observation)
        if change is not None:  # last, as nothing can stop it
            change()
        return True

    def _keep_looks(self, frame: RgbdFrame, detections: Detections) -> None:
        """Keep pictures and embeddings of the objects that a mapped frame shows."""
        if not self._looks_for_objects:
            return
        config = self.config.pictures
        if config.enabled:
            keep_pictures(frame, detections, self.evidence, config)
        if self.embedder is not None:
            embed_objects(frame, detections, self.evidence, self.embedder, config.people)

    def correct_poses_by(self, occupancy: OccupancyLayer) -> None:
        """Correct the poses of all later frames by an occupancy layer in their frame.

        The first layer of the map stays unchanged.
        """
        self.evidence.is_free = partial(free_share, occupancy)
        if self._aligner is None:
            self._aligner = Aligner(occupancy, self.config.alignment)
        else:
            self._aligner.replace_map(occupancy)

    @overload
    def correct(
        self,
        trajectory: Trajectory,
        on_progress: Callable[[int, int], None] | None = None,
        *,
        is_under_way: bool = False,
    ) -> Correction: ...

    @overload
    def correct(
        self,
        trajectory: Trajectory,
        on_progress: Callable[[int, int], None] | None = None,
        *,
        is_under_way: bool = False,
        least: float,
    ) -> Correction | None: ...

    def correct(
        self,
        trajectory: Trajectory,
        on_progress: Callable[[int, int], None] | None = None,
        *,
        is_under_way: bool = False,
        least: float = -1.0,
    ) -> Correction | None:
        """Replace the poses of the newest frames, as after a loop closure, and map them again.

        The map is rebuilt at the corrected poses, without images: objects and their evidence move,
        appear and vanish, and so do the cells of an occupancy layer made from depth. Corrections
        of position and yaw are applied, those of roll and pitch ignored. Objects keep their ids,
        pictures and edits made by hand. Samples of value layers move along, and their fields are
        estimated again. Only the newest 1000 to 2000 frames can be corrected.

        Args:
            trajectory: of the camera's optical frame in the map, over all frames of the drives to
                correct; other drives stay. It may have fewer poses than frames.
            on_progress: called with the number of frames done and the number of all frames to map.
            is_under_way: whether the drive continues: frames before and after the trajectory get
                the nearest correction.
            least: the map changes only if a frame moves farther [m]; by default it always does.

        Returns:
            The effect of the correction; None if no frame moves far enough.

        Raises:
            CannotCorrect: If the trajectory lacks a pose for a frame of these drives, or the map
                has no frames to map again; the map stays unchanged.
        """
        drives = self.intake.drives()
        poses, is_moved = corrected_poses(self._frame_log, drives, trajectory, is_under_way)
        correction = Correction.of(self._frame_log, drives, poses, is_moved, is_under_way)
        if correction.most <= least:
            return None
        made = map_again(
            self._frame_log, poses, self.evidence, self.config, self.evidence.is_free, on_progress
        )
        self._shifts.add(self._frame_log, made.log, drives)
        self.evidence, self._occupancy, self._frame_log = made.evidence, made.occupancy, made.log
        self.keyframes.go_on_from(poses[-1])
        self._base = with_moved_samples(self._base, correction.motions, self.occupancy)
        if self.place is not None:
            self.place.begin_again()
        return correction

    def logged_poses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stamps [s] and poses (`map_T_camera`) of the frames that `correct` can move.

        Returns:
            Shapes (N,) and (N, 4, 4).
        """
        rows = can_be_corrected(self._frame_log, self.intake.drives())
        return self._frame_log.stamps[rows], self._frame_log.poses[rows]

    @property
    def corrects_poses(self) -> bool:
        """Whether poses are corrected by an occupancy layer where that improves them."""
        return self._aligner is not None and self.config.alignment.enabled

    @property
    def makes_occupancy(self) -> bool:
        """Whether the first layer is made from depth."""
        return self._given_occupancy is None

    def hypermap(self) -> Hypermap:
        """Return the map so far: the layers "occupancy" and "semantic", in one frame.

        Without a source of detections there is no layer "semantic". A continued map keeps its other
        layers.
        """
        layers: list[Layer] = [self.occupancy()]
        published: list[SemanticObject] = []
        if self._has_objects:
            layer = self.evidence.layer(frame_id=layers[0].frame_id)
            layers.append(layer)
            published = layer.objects()
        metadata = made_metadata(
            self._base.metadata,
            self.config,
            self.intake.drives(),
            self.intake.all_counts,
            self.intake.surplus,
            self._aligner if self.corrects_poses else None,
            self.evidence.hand_edits(),
        )
        made = Hypermap(replaced(self._base, layers), self._base.frames, metadata)
        made.mapper_state = cache(partial(dump_state, self._state(published)))
        made.history = replace(self._base.history or History(), mapped=self._mapped(published))
        return made

    def _mapped(self, published: list[SemanticObject]) -> Mapped:
        """Return the source of the present changes, for the map's history."""
        drive = self.intake.drive
        shifts = self._shifts.by_id()
        name = drive.name or ("" if shifts is None else "corrected poses")
        if not self.intake.is_another_drive:
            return Mapped(name, drive.time, shifts=shifts)
        doubt = doubt_about_changes(
            self._frame_log.parts,
            self.intake.drives(),
            self.config,
            layer_of_objects(self._base),
            published,
            self.evidence.settled(),
        )
        return Mapped(name, drive.time, doubt, shifts)

    def _state(self, published: list[SemanticObject]) -> MapperState:
        """Return a copy of the state that is needed to continue."""
        first_cell, log_odds = self._made_cells()
        return MapperState(
            tracks=self.evidence.tracks(),
            keyframe=self.keyframes.last,
            first_cell=first_cell,
            log_odds=log_odds,
            drives=self.intake.drives(),
            counts=self.intake.all_counts,
            published=published,
            alignment=None if self._aligner is None else self._aligner.learned,
            log=FrameLog(self._frame_log.parts).parts,
            apart=self.evidence.apart(),
        )

    def _map_before(self) -> MapBefore:
        """Return the present map, from which the next frames can be mapped again."""
        return MapBefore.of(self.evidence.tracks(), *self._made_cells())

    def _made_cells(self) -> tuple[NDArray[np.int64], NDArray[np.float32] | None]:
        """Return the first cell and the log-odds of all; None for these if the layer was given."""
        first_cell, log_odds = self._occupancy.log_odds()
        return first_cell, log_odds if self.makes_occupancy else None

    def occupancy(self) -> OccupancyLayer:
        """Return the first layer of the map: the given one, or the one made from depth so far."""
        if self._given_occupancy is not None:
            return self._given_occupancy
        return self._occupancy.layer(frame_id=self._frame_id)

    @property
    def counts(self) -> Counts:
        """Frame counts of this drive so far."""
        return self.intake.counts

    @property
    def keyframes(self) -> KeyframeSelector:
        """Skips frames whose camera has hardly moved."""
        return self.intake.keyframes

    @property
    def perceiver(self) -> Perceiver:
        """The perception of single frames, with this mapper's settings."""
        occupancy = self.config.occupancy if self.makes_occupancy else None
        return Perceiver(
            self._source, self.config.perception, occupancy, is_watched=self.watch is not None
        )


def _perceive_now(frame: RgbdFrame, perceiver: Perceiver) -> Perceived:
    return perceiver(frame)
