"""Maps a recording with a progress bar, until its end or a signal."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import typer

from hypermap.cli.corrected_poses import CorrectedJob
from hypermap.cli.map_result import note_frames
from hypermap.cli.onto import named, way_to_join
from hypermap.cli.signals import Stop
from hypermap.cli.terminal import note
from hypermap.cli.worker_options import MOST_WORKERS, opened_workers
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.cli.progress import Report
    from hypermap.cli.stopping import StoppableRecording
    from hypermap.cli.watching import Watched
    from hypermap.core.hypermap import Hypermap
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.fleet.ahead import LookedAtAhead
    from hypermap.mapping.config import MappingConfig
    from hypermap.mapping.counts import Counts
    from hypermap.mapping.floor_motions import PoseChanges
    from hypermap.mapping.mapper import MappedFrame, Mapper
    from hypermap.mapping.preflight import Preflight
    from hypermap.mapping.recording_to_map import Progress
    from hypermap.perception.detectors.origin import DetectionOrigin
    from hypermap.perception.embedders.embedder import Embedder
    from hypermap.perception.frame import DetectionSource

    Watcher: TypeAlias = Callable[[MappedFrame, Mapper], None]


@dataclass(frozen=True)
class Job:
    """What to map, onto what, where to save it, and how.

    `base` is the map of the file `onto`; `is_same_place` whether the user vouches for its frame.
    """

    origin: DetectionOrigin | None
    source: DetectionSource | None
    settings: MappingConfig
    occupancy: OccupancyLayer | None
    base: Hypermap | None
    onto: Path | None
    output: Path
    is_same_place: bool
    max_bad: float
    embedder: Embedder | None
    workers: int | None
    address: str | None
    corrected: CorrectedJob


@dataclass(frozen=True)
class Made:
    """A map, what became of the frames, and until when they are those of the recording [s].

    `moves` are the corrections of their poses, one after the other.
    """

    hypermap: Hypermap
    counts: Counts
    until: float
    moves: tuple[PoseChanges, ...]

    @property
    def is_whole(self) -> bool:
        """Whether they are all frames of the recording."""
        return math.isinf(self.until)


def make_map(
    job: Job,
    frames: int,
    stop: Stop,
    watched: Watched,
    watchers: list[Watcher],
    preflight: Preflight,
) -> Made:
    """Map the recording until its end or `stop`."""
    from hypermap.cli.progress import mapping_progress
    from hypermap.cli.stopping import StoppableRecording
    from hypermap.mapping.floor_motions import PoseChanges
    from hypermap.mapping.recording_to_map import map_recording

    started, changes = time.monotonic(), PoseChanges()
    with mapping_progress(frames) as report, _looking_ahead(job) as ahead:

        def prepare(mapper: Mapper) -> None:
            mapper.pose_changes = changes
            if mapper.place is not None and job.onto is not None:
                recording = job.corrected.recording.path
                mapper.place.remedy = way_to_join(recording, job.onto, job.output)

        stoppable, pace = StoppableRecording(ahead or job.corrected.recording, stop), _Paced(report)
        with _named_errors(job.onto, stoppable, stop):
            hypermap = map_recording(
                stoppable,
                job.source,
                job.settings,
                job.occupancy,
                watched.with_progress(pace),
                _each(watchers) if watchers else None,
                preflight,
                job.max_bad,
                job.base,
                job.embedder,
                ahead,
                job.is_same_place,
                prepare,
            )
    from hypermap.mapping.pose_ways import described

    by_graph = job.corrected.poses
    hypermap.metadata = described(hypermap.metadata, by_graph)
    note_frames(hypermap, pace.counts, job.settings, time.monotonic() - started, pace.rate)
    moves = (changes,) if by_graph is None else (by_graph.changes(), changes)
    return Made(hypermap, pace.counts, min(stoppable.until, job.corrected.until), moves)


@contextmanager
def _named_errors(onto: Path | None, stoppable: StoppableRecording, stop: Stop) -> Iterator[None]:
    """Name the map in errors about it; end without one if nothing was mapped before a signal."""
    from hypermap.mapping.same_place import OtherPlace

    try:
        with named(onto):
            yield
    except OtherPlace as error:
        raise OtherPlace(f"{onto}: {error}") from error
    except HypermapError:
        if stoppable.ended_early:
            note("no frame was mapped so far, so nothing is saved")
            raise typer.Exit(stop.exit_code) from None
        raise


class _Paced:
    """Reports progress, and keeps the counts of frames and how many are mapped per second."""

    def __init__(self, report: Report) -> None:
        from hypermap.cli.progress import Pace
        from hypermap.mapping.counts import Counts

        self.counts, self.rate = Counts(), 0.0
        self._report, self._pace = report, Pace()

    def __call__(self, progress: Progress) -> None:
        self.counts = progress.counts
        self.rate = self._pace.after(progress.done)
        self._report(progress)


def _each(watchers: list[Watcher]) -> Watcher:
    def watch(mapped: MappedFrame, mapper: Mapper) -> None:
        for watcher in watchers:
            watcher(mapped, mapper)

    return watch


@contextmanager
def _looking_ahead(job: Job) -> Iterator[LookedAtAhead | None]:
    """Yield the recording as workers look at it, if there are to be any."""
    if job.workers in (None, 1) and job.address is None:
        yield None
        return
    from hypermap.fleet.ahead import LookedAtAhead

    with opened_workers(job.workers, job.address, MOST_WORKERS) as workers:
        yield LookedAtAhead(job.corrected.recording, workers, job.origin)
