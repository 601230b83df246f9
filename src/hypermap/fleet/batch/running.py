"""One job of a batch, in a worker: map a recording, and compare the map with the truth."""

from __future__ import annotations

import hashlib
import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hypermap._version import __version__
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.evaluation import evaluate, map_objects
from hypermap.fleet.batch.jobs import Job
from hypermap.formats import save_map
from hypermap.formats.any_file import open_any
from hypermap.formats.grid.map_server import load_occupancy
from hypermap.mapping.config import to_dict
from hypermap.mapping.pose_graph import CorrectedRecording, correct_poses
from hypermap.mapping.pose_ways import described, is_by_graph, with_way
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.catalog import known_network
from hypermap.perception.detectors.origin import detection_origin
from hypermap.perception.frame import DetectionSource
from hypermap.perception.recording import PendingRecording
from hypermap.recordings import open_recording

_CHUNK = 1 << 20  # bytes that are read at a time


@dataclass(frozen=True)
class Done:
    """What became of a job.

    Attributes:
        key: what the map is made of; see `key_of`.
        content: the map's file; None if it is there already.
        figures: for the table: frames, seconds, frames/s, objects, and f1, precision, recall and
            iou if the truth is known.
    """

    key: str
    content: bytes | None
    figures: dict[str, Any]


def run(job: Job, known_key: str | None, threads: int) -> Done:
    """Map the recording of a job.

    Args:
        job: what is to be done.
        known_key: key of the map that is there; None if there is none.
        threads: how many a network may use.

    Raises:
        HypermapError: If it cannot be mapped.
    """
    key = key_of(job)
    if key == known_key:
        return Done(key, None, {})
    began = time.monotonic()
    recording = open_recording(job.recording, job.options)
    score = job.config.perception.min_score
    origin = detection_origin(
        recording, job.detector, job.labels, score, job.detections, job.objects
    )
    occupancy = None if job.map is None else load_occupancy(job.map, recording.frame_id)
    source = None if origin is None else origin.open(threads)
    hypermap = _mapped(job, recording, source, occupancy)
    seconds = time.monotonic() - began
    frames = sum(hypermap.metadata["frames"].values())
    figures = {
        "frames": frames,
        "seconds": round(seconds, 2),
        "frames_per_second": round(frames / seconds, 2),
        "objects": sum(len(layer) for layer in hypermap if isinstance(layer, SemanticLayer)),
    }
    with tempfile.TemporaryDirectory(prefix="hypermap-batch-") as folder:
        path = Path(folder) / "map.hmap"
        save_map(hypermap, path)
        if job.truth is not None:
            figures |= _compared(path, job.truth)
        return Done(key, path.read_bytes(), figures)


def _mapped(
    job: Job,
    recording: PendingRecording,
    source: DetectionSource | None,
    occupancy: OccupancyLayer | None,
) -> Hypermap:
    """Return the map of a job, whose poses are corrected first if it says so."""
    has_map = occupancy is not None
    config = with_way(job.config, job.correct_poses, has_map)
    if not is_by_graph(job.correct_poses, has_map):
        return map_recording(recording, source, config, occupancy)
    poses = correct_poses(recording)
    hypermap = map_recording(CorrectedRecording(recording, poses.poses), source, config, occupancy)
    hypermap.metadata.update(described(hypermap.metadata, poses))
    return hypermap


def key_of(job: Job) -> str:
    """Return a hash of all that a map depends on: contents of files, configuration and version."""
    digest = hashlib.blake2b(digest_size=16)
    settings = {
        "version": __version__,
        "config": to_dict(job.config),
        "options": vars(job.options),
        "objects": job.objects,
        "detector": job.detector,
        **({} if job.correct_poses is None else {"correct_poses": job.correct_poses}),
    }
    digest.update(json.dumps(settings, sort_keys=True, default=str).encode())
    network = None if job.detector is None else known_network(job.detector)
    model = network.path if network is not None else Path(job.detector or "")
    for role, path in (
        ("recording", job.recording),
        ("model", model if job.detector is not None and model.is_file() else None),
        ("labels", job.labels),
        ("detections", job.detections),
        ("map", job.map),
        ("map image", None if job.map is None else job.map.with_suffix(".pgm")),
        ("truth", job.truth),
    ):
        if path is not None and path.exists():
            digest.update(role.encode())
            _add(digest, path)
    return digest.hexdigest()


def _add(digest: Any, path: Path) -> None:
    for name, file in _files(path):
        digest.update(f"\n{name} {file.stat().st_size}\n".encode())
        with file.open("rb") as content:
            while chunk := content.read(_CHUNK):
                digest.update(chunk)


def _files(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield the files at a path with their names in it, in a fixed order."""
    if path.is_file():
        yield path.name, path
        return
    for file in sorted(path.rglob("*")):
        if file.is_file():
            yield file.relative_to(path).as_posix(), file


def _compared(path: Path, truth_path: Path) -> dict[str, Any]:
    """Return the figures of a map against the truth."""
    true_map = open_any(truth_path)
    truth = map_objects(true_map, str(truth_path))
    objects = map_objects(open_any(path), path.name, true_map, truth.name)
    overall = evaluate(objects.objects, truth.objects).overall
    first = overall.detection[0]
    values = {
        "f1": first.f1,
        "precision": first.precision,
        "recall": first.recall,
        "iou": overall.iou,
    }
    return {name: None if value is None else round(value, 4) for name, value in values.items()}
