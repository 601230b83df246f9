"""The configuration of a map, `hmap_config.yaml`: its layers in order, and their frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import Field

from hypermap.core.errors import FormatError, FrameError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.formats.atomic import is_folder
from hypermap.formats.checked import Checked, Pose, Text, check
from hypermap.formats.yaml_text import read_yaml, write_yaml

CONFIG_NAME = "hmap_config.yaml"
METADATA_KEY = "hypermap_metadata"

BINARY_FILE = "binary_file"
"""The key of a layer that names a file which old readers do not know. For their sake `load_file`
is false then, so that they start with an empty layer."""

FLAGS = {"subscribe_mode": False, "enable_update": True, "publish_global_topics": False}
"""Settings of every layer, and their defaults."""

_TEXT = {("layers", "*", key) for key in ("class", "name", "frame_id", "file", BINARY_FILE)} | {
    ("transforms", "*", key) for key in ("frame_id", "child_frame_id")
}


def file_of_map(path: Path) -> Path:
    """Return the file of a map: for a folder, the configuration in it."""
    return path / CONFIG_NAME if is_folder(path) else path


@dataclass(frozen=True)
class LayerEntry:
    """A layer in the configuration.

    Attributes:
        class_name: which kind of layer it is.
        name: unique within the map.
        frame_id: the frame of its coordinates.
        load_file: whether there is a file; otherwise the layer starts empty.
        settings: `file`, `binary_file`, the flags, and keys of other programs.
    """

    class_name: str
    name: str
    frame_id: str
    load_file: bool
    settings: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class MapConfig:
    """The content of a configuration.

    Attributes:
        layers: in order; the first one's frame is the base frame.
        frames: the transforms.
        metadata: of the map, as the configuration that made it.
        others: keys of other programs, written back as they were.
    """

    layers: list[LayerEntry]
    frames: FrameTree = field(default_factory=FrameTree)
    metadata: dict[Any, Any] = field(default_factory=dict)
    others: dict[Any, Any] = field(default_factory=dict)


class _Layer(Checked):
    class_name: Text = Field(alias="class")
    name: Text
    frame_id: Text
    load_file: bool | None = None
    file: Text | None = None
    binary_file: Text | None = None
    subscribe_mode: bool = FLAGS["subscribe_mode"]
    enable_update: bool = FLAGS["enable_update"]
    publish_global_topics: bool = FLAGS["publish_global_topics"]


class _Transform(Checked):
    frame_id: Text
    child_frame_id: Text
    transform_pose: Pose


class _Config(Checked):
    layers: list[Any]
    transforms: list[Any] | None = None
    hypermap_metadata: dict[Any, Any] | None = None


def parse_config(content: bytes, path: str) -> MapConfig:
    """Return the content of a configuration file.

    Args:
        content: the file.
        path: its name in messages.

    Raises:
        FormatError: With the position of the error, such as "layers[1].frame_id".
    """
    raw = read_yaml(content, path, _TEXT)
    config = check(_Config, raw, path)
    layers = [_parse_layer(item, path, f"layers[{i}]") for i, item in enumerate(config.layers)]
    _check_names(layers, path)
    return MapConfig(
        layers=layers,
        frames=_parse_transforms(config.transforms or [], path),
        metadata=config.hypermap_metadata or {},
        others={key: value for key, value in raw.items() if key not in _Config.known_keys()},
    )


def dump_config(config: MapConfig) -> bytes:
    """Return the configuration as a file; keys of the first program come first."""
    others = dict(config.others)
    if "layer_cnt" in others:  # an old key that no program reads, but which should not lie
        others["layer_cnt"] = len(config.layers)
    document: dict[Any, Any] = {"layers": [_dump_layer(entry) for entry in config.layers]}
    if len(config.frames):
        document["transforms"] = [
            {
                "frame_id": transform.parent,
                "child_frame_id": transform.child,
                "transform_pose": [transform.pose.x, transform.pose.y, transform.pose.yaw],
            }
            for transform in config.frames
        ]
    if config.metadata:
        document[METADATA_KEY] = config.metadata
    return write_yaml({**document, **others})


def _parse_layer(raw: Any, path: str, place: str) -> LayerEntry:
    layer = check(_Layer, raw, path, place)
    load_file = layer.file is not None if layer.load_file is None else layer.load_file
    if load_file and layer.file is None:
        raise FormatError("is required where load_file is true", path=path, key=f"{place}.file")
    files = {"file": layer.file, BINARY_FILE: layer.binary_file}
    settings: dict[str, Any] = {key: name for key, name in files.items() if name is not None}
    settings.update((flag, getattr(layer, flag)) for flag in FLAGS)
    settings.update((k, v) for k, v in raw.items() if k not in _Layer.known_keys())
    return LayerEntry(layer.class_name, layer.name, layer.frame_id, load_file, settings)


def _dump_layer(entry: LayerEntry) -> dict[Any, Any]:
    head = {
        "class": entry.class_name,
        "name": entry.name,
        "frame_id": entry.frame_id,
        "load_file": entry.load_file,
    }
    file = {"file": entry.settings["file"]} if "file" in entry.settings else {}
    return {**head, **file, **FLAGS, **{k: v for k, v in entry.settings.items() if k not in head}}


def _check_names(layers: list[LayerEntry], path: str) -> None:
    first: dict[str, int] = {}
    for index, layer in enumerate(layers):
        if layer.name in first:
            raise FormatError(
                f"{layer.name!r} is already the name of layers[{first[layer.name]}]",
                path=path,
                key=f"layers[{index}].name",
            )
        first[layer.name] = index


def _parse_transforms(items: list[Any], path: str) -> FrameTree:
    frames = FrameTree()
    for index, item in enumerate(items):
        place = f"transforms[{index}]"
        transform = check(_Transform, item, path, place)
        pose = Pose2D(*transform.transform_pose)
        try:
            frames.add(Transform(transform.frame_id, transform.child_frame_id, pose))
        except FrameError as error:
            raise FormatError(str(error), path=path, key=place) from None
    return frames
