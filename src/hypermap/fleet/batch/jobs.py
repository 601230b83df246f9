"""The jobs of a batch: from a YAML file, or of recordings, and with settings that vary."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hypermap.core.errors import FileMissing, FormatError, HypermapError, did_you_mean
from hypermap.formats.yaml_text import read_yaml
from hypermap.mapping.config import MappingConfig, chosen_config
from hypermap.mapping.overrides import override, read_overrides
from hypermap.mapping.pose_ways import WAYS
from hypermap.recordings.open import is_recording, recordings_in
from hypermap.recordings.options import RecordingOptions
from hypermap.simple_yaml import parse_simple_yaml

TRUTH = "truth.hmap"
"""The true map in the folder of a recording, with which its map is compared."""

_NAME = re.compile(r"[^\w.@=,-]+")
_PATHS = ("recording", "labels", "detections", "map", "config", "truth")
_WORDS = ("name", "detector", "profile", "correct_poses")
_KEYS = (*_PATHS, *_WORDS, "objects", "options")


@dataclass(frozen=True)
class Job:
    """One recording that is to be mapped in one way.

    Attributes:
        name: of its files, without an ending; no other job of a batch has it.
        recording: where it is.
        config: how it is mapped.
        options: how it is read.
        detector: see `load_detector`; None for recorded detections.
        labels: file of the detector's class names.
        detections: file of detections.
        objects: whether objects are mapped.
        map: occupancy map (map_server YAML); None for one made from depth.
        truth: the true map; None if it is not known.
        correct_poses: how poses are corrected, one of `WAYS`; None for that of `config`.
        settings: those that vary in this batch, as ("evidence.loss", 0.1).
    """

    name: str
    recording: Path
    config: MappingConfig
    options: RecordingOptions = field(default_factory=RecordingOptions)
    detector: str | None = None
    labels: Path | None = None
    detections: Path | None = None
    objects: bool = True
    map: Path | None = None
    truth: Path | None = None
    correct_poses: str | None = None
    settings: tuple[tuple[str, Any], ...] = ()


def jobs_in(source: Path, common: Mapping[str, Any] | None = None) -> list[Job]:
    """Return the jobs of a YAML file, or one for each recording in a folder.

    Args:
        source: the file, whose paths are relative to it, the folder, or a single recording.
        common: values for all jobs that do not say otherwise, by the keys of the file.

    Raises:
        FileMissing: If there is nothing.
        FormatError: If the file does not hold jobs; names the job and the key.
        HypermapError: If there are no recordings, or two jobs would write the same file.
    """
    if source.is_dir() or is_recording(source):
        entries: list[Any] = [{"recording": path} for path in recordings_in(source)]
        if not entries:
            raise HypermapError(f"{source}: there is no recording in this folder")
        folder = Path()
    elif source.is_file():
        entries, own = _read(source)
        common, folder = {**(common or {}), **own}, source.parent
    else:
        raise FileMissing(f"{source}: there is no such file or folder of recordings")
    jobs = [
        _job(entry, common or {}, folder, source, f"job {number}")
        for number, entry in enumerate(entries, start=1)
    ]
    return checked(jobs)


def swept(jobs: Sequence[Job], sweeps: Sequence[str]) -> list[Job]:
    """Return each job with each combination of values of some settings.

    Args:
        jobs: the jobs.
        sweeps: such as "evidence.loss=0.1,0.2".

    Raises:
        HypermapError: If a setting is unknown or a value is not allowed.
    """
    choices = [_choices(text) for text in sweeps]
    keys = [key for key, _ in choices]
    if twice := next((key for key in keys if keys.count(key) > 1), None):
        raise HypermapError(f"--set {twice}: given twice; separate values by commas")
    if not choices:
        return list(jobs)
    return checked(
        [
            _with_settings(job, tuple(zip(keys, values, strict=True)))
            for job in jobs
            for values in itertools.product(*(values for _, values in choices))
        ]
    )


def checked(jobs: list[Job]) -> list[Job]:
    """Return jobs of which no two write the same file.

    Raises:
        HypermapError: If two do; names both recordings.
    """
    known: dict[str, Job] = {}
    for job in jobs:
        other = known.setdefault(job.name.lower(), job)
        if other is not job:
            raise HypermapError(
                f"two jobs would write {job.name}.hmap, of {other.recording} and of "
                f"{job.recording}; give one of them another name (name: in the jobs file)"
            )
    return jobs


def _read(path: Path) -> tuple[list[Any], dict[str, Any]]:
    """Return the entries of a jobs file, and what it says for all of them."""
    content = read_yaml(path.read_bytes(), str(path))
    if not isinstance(content, dict) or not isinstance(content.get("jobs"), list):
        raise FormatError(
            "expected a list `jobs:` of recordings, each as `- recording: PATH`", path=path
        )
    common = {key: value for key, value in content.items() if key != "jobs"}
    _check_keys(common, path, "for all jobs", (*(set(_KEYS) - {"recording", "name"}), "jobs"))
    if not content["jobs"]:
        raise FormatError("there are no jobs", path=path, key="jobs")
    return content["jobs"], common


def _check_keys(values: Mapping[str, Any], path: Path, place: str, known: Sequence[str]) -> None:
    for key in values:
        if key not in known:
            hint = did_you_mean(str(key), sorted(known))
            raise FormatError(f"unknown key {key!r}; {hint}", path=path, key=place)


def _job(entry: Any, common: Mapping[str, Any], folder: Path, path: Path, place: str) -> Job:
    if not isinstance(entry, dict) or entry.get("recording") is None:
        raise FormatError("expected `recording: PATH` and other keys", path=path, key=place)
    _check_keys(entry, path, place, _KEYS)
    values = {**common, **entry}
    for key in (*_PATHS, *_WORDS):
        if not isinstance(values.get(key), str | Path | None):
            raise FormatError(
                f"expected a text, found {values[key]!r}", path=path, key=f"{place}: {key}"
            )
        if values.get(key) is not None:
            _check_name(folder / values[key], path, f"{place}: {key}")
    if not isinstance(values.get("objects", True), bool):
        raise FormatError("expected true or false", path=path, key=f"{place}: objects")
    paths = {key: folder / values[key] for key in _PATHS if values.get(key) is not None}
    recording = paths["recording"]
    own_truth = recording / TRUTH
    stem = recording.stem.strip(".") or recording.resolve().stem
    detector = values.get("detector")
    if detector is not None and (folder / detector).is_file():
        detector = str(folder / detector)
    return Job(
        name=_NAME.sub("_", values.get("name") or stem),
        recording=recording,
        config=_config(values, paths.get("config"), path, place),
        options=_options(values.get("options") or {}, path, place),
        detector=detector,
        labels=paths.get("labels"),
        detections=paths.get("detections"),
        objects=values.get("objects", True),
        map=paths.get("map"),
        correct_poses=_way(values, path, place),
        truth=paths.get("truth") or (own_truth if own_truth.is_file() else None),
    )


def _check_name(named: Path, path: Path, key: str) -> None:
    """Refuse what no file can be called, such as 300 letters; that it is missing shows later."""
    try:
        named.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return
    except (OSError, ValueError) as error:
        raise FormatError(f"no file can have this name: {error}", path=path, key=key) from None


def _way(values: Mapping[str, Any], path: Path, place: str) -> str | None:
    way: str | None = values.get("correct_poses")
    key = f"{place}: correct_poses"
    if way is not None and way not in WAYS:
        raise FormatError(f"unknown way {way!r}; {did_you_mean(way, WAYS)}", path=path, key=key)
    if way == "map" and values.get("map") is None:
        raise FormatError("no occupancy map is known; give map, or graph", path=path, key=key)
    return way


def _config(values: Mapping[str, Any], file: Path | None, path: Path, place: str) -> MappingConfig:
    has_network = values.get("detector") is not None
    if file is not None:
        read_overrides(file)
    try:
        return chosen_config(values.get("profile"), file, None, has_network)
    except ValueError as error:
        raise FormatError(str(error), path=path, key=f"{place}: profile") from None


def _options(values: Any, path: Path, place: str) -> RecordingOptions:
    known = [field.name for field in dataclasses.fields(RecordingOptions)]
    key = f"{place}: options"
    if not isinstance(values, dict):
        raise FormatError("expected keys and values, such as every: 2", path=path, key=key)
    _check_keys(values, path, key, known)
    given: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in values.items()
    }
    try:
        return RecordingOptions(**given)
    except (TypeError, ValueError) as error:
        raise FormatError(str(error), path=path, key=key) from None


def _choices(text: str) -> tuple[str, list[Any]]:
    """Return the key and the values of "KEY=VALUE,VALUE"."""
    key, equals, values = text.partition("=")
    if not equals or key.count(".") != 1 or not values:
        raise HypermapError(
            f"--set {text}: expected STAGE.KEY=VALUE,VALUE, as evidence.loss=0.1,0.2"
        )
    try:
        return key, [parse_simple_yaml(value) for value in values.split(",")]
    except ValueError:
        raise HypermapError(f"--set {text}: a value cannot be read") from None


def _with_settings(job: Job, settings: tuple[tuple[str, Any], ...]) -> Job:
    config = job.config
    for key, value in settings:
        stage, name = key.split(".")
        try:
            config = override(config, {stage: {name: value}})
        except FormatError as error:
            raise HypermapError(f"--set {error}") from None
    said = ",".join(f"{key}={value}" for key, value in settings)
    name = _NAME.sub("_", f"{job.name}@{said}")
    return dataclasses.replace(job, config=config, name=name, settings=settings)
