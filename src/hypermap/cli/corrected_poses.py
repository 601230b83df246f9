"""`--correct-poses`: whether the poses of a recording are corrected, and by what."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import check_output
from hypermap.cli.progress import counting
from hypermap.cli.signals import Stop, stop_on_signal
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.mapping.config import MappingConfig
    from hypermap.mapping.pose_graph.correction import CorrectedPoses
    from hypermap.perception.recording import PendingRecording

CorrectPoses = Annotated[
    str | None,
    typer.Option(
        "--correct-poses",
        metavar="none|map|graph|auto",
        show_default="map, with the profile default",
        help="Correct the poses of the frames: map: by the occupancy map, if it is known; graph: "
        "without a map, as odometry needs it: frames are matched to each other, loops closed; "
        "auto: map, or else graph.",
    ),
]

SavePoses = Annotated[
    Path | None,
    typer.Option(
        "--save-poses",
        metavar="FILE",
        show_default=False,
        help="Save the trajectory of the camera as corrected by graph here, in TUM format.",
    ),
]


@dataclass(frozen=True)
class PoseCorrection:
    """How poses are to be corrected, as the user said it.

    Attributes:
        way: one of the four; None for that of the configuration.
        save: where the corrected trajectory is to be saved, if at all.
        has_map: whether an occupancy map is known from the start.
    """

    way: str | None
    save: Path | None
    has_map: bool

    def __post_init__(self) -> None:
        from hypermap.mapping.pose_ways import WAYS

        if self.way is not None and self.way not in WAYS:
            raise HypermapError(f"--correct-poses {self.way}: {did_you_mean(self.way, WAYS)}")
        if self.way == "map" and not self.has_map:
            raise HypermapError(
                "--correct-poses map: no occupancy map is known; give --map, or correct by graph"
            )
        if self.save is not None and not self.by_graph:
            raise HypermapError("--save-poses: needs --correct-poses graph")

    @property
    def by_graph(self) -> bool:
        """Whether they are corrected without a map."""
        from hypermap.mapping.pose_ways import is_by_graph

        return is_by_graph(self.way, self.has_map)

    def settings(self, config: MappingConfig) -> MappingConfig:
        """Return a configuration that says whether poses are corrected by the map."""
        from hypermap.mapping.pose_ways import with_way

        return with_way(config, self.way, self.has_map)

    def check_file(self, output: Path, inputs: Iterable[Path | None], force: bool) -> None:
        """Make sure that the trajectory can be saved, and not over anything else that is in use.

        Args:
            output: the map that is to be saved.
            inputs: files that are read, and folders of which any file may be.
            force: whether a trajectory file is replaced.

        Raises:
            HypermapError: If it cannot.
        """
        if self.save is None:
            return
        target = self.save.resolve()
        if target == output.resolve():
            raise HypermapError(f"--save-poses {self.save}: the map is saved there; give another")
        for path in filter(None, inputs):
            of_folder = path.resolve() in target.parents and target.exists()
            if of_folder or target == path.resolve():
                raise HypermapError(
                    f"--save-poses {self.save}: this is {'a file of ' if of_folder else ''}"
                    f"{path}, which is read; give another name"
                )
        check_output(self.save, force)

    def corrected(self, recording: PendingRecording) -> CorrectedJob:
        """Return a recording with poses corrected by a graph; the same if by none.

        A signal ends the correction: what was read so far is what is to be mapped.

        Args:
            recording: what is to be mapped.

        Raises:
            HypermapError: If the trajectory cannot be saved.
            typer.Exit: If a signal came before any frame.
        """
        if not self.by_graph:
            return CorrectedJob(recording, None, Stop())
        from hypermap.cli.stopping import StoppableRecording
        from hypermap.formats.atomic import write_file
        from hypermap.mapping.pose_graph import CorrectedRecording, correct_poses

        with stop_on_signal() as stop:
            stoppable = StoppableRecording(recording, stop, "correcting the poses read so far")
            with counting("correcting poses", len(recording), "frame") as count:
                made = correct_poses(stoppable, count)
        if stop.is_wanted and not made.poses:
            note("no frame was read so far, so nothing is saved")
            raise typer.Exit(stop.exit_code)
        if self.save is not None:
            write_file(self.save, made.tum().encode())
            note(f"saved {self.save}")
        if stop.is_wanted:
            frames = counted(len(made.poses), "frame")
            note(
                f"mapping the {frames} whose poses were corrected before {stop.name}; Ctrl-C now "
                "saves the map so far"
            )
        corrected = CorrectedRecording(recording, made.poses, stoppable.until)
        return CorrectedJob(corrected, made, stop, stoppable.until)


@dataclass(frozen=True)
class CorrectedJob:
    """What is to be mapped, once its poses are corrected.

    Attributes:
        recording: with corrected poses.
        poses: these; None if they were not corrected by a graph.
        stop: whether a signal has ended the correction.
        until: stamp of the newest frame of the recording [s]; infinite if none is left out.
    """

    recording: PendingRecording
    poses: CorrectedPoses | None
    stop: Stop
    until: float = math.inf


def known_map(base: Hypermap, config: MappingConfig) -> bool:
    """Return whether a map's occupancy layer was given to mapping, and not made from depth.

    Args:
        base: a map of earlier drives.
        config: its configuration.

    Raises:
        CannotGoOn: If the state of its mapper cannot be read.
    """
    from hypermap.mapping.going_on import state_of

    return state_of(base, config).log_odds is None
