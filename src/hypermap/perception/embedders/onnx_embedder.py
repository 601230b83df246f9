"""Encoders of images and texts in a folder, as CLIP, MobileCLIP and SigLIP are exported to ONNX."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.embeddings import MOST_NUMBERS
from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.onnx_model import MAX_SIDE, open_session
from hypermap.perception.embedders.embedder import unit_vectors

if TYPE_CHECKING:
    from hypermap.perception.embedders.tokens import Tokens

_IMAGE_FILES = ("vision_model.onnx", "image_encoder.onnx", "visual.onnx")
_TEXT_FILES = ("text_model.onnx", "text_encoder.onnx", "textual.onnx")
_OUTPUTS = ("image_embeds", "text_embeds", "pooler_output", "embeddings")
_SIDE = 224  # pixels, where nothing says another size
# Of CLIP's training images, and so of most encoders after it.
_MEAN = (0.48145466, 0.4578275, 0.40821073)
_DEVIATION = (0.26862954, 0.26130258, 0.27577711)


@dataclass(frozen=True)
class _Preparation:
    """How the image encoder takes images."""

    size: tuple[int, int]  # columns and rows
    mean: NDArray[np.float32]
    deviation: NDArray[np.float32]


class OnnxEmbedder:
    """The encoders in a folder.

    The folder has `vision_model.onnx`, `text_model.onnx` (in it or in its folder `onnx`), and
    `tokenizer.json`; `preprocessor_config.json` and `tokenizer_config.json` are read if they are
    there. Each is loaded when it is first used.

    Attributes:
        model: the folder's name and a checksum of the encoder of images.

    Args:
        folder: the files.
        threads: how many the encoders may use; None for all cores.

    Raises:
        FileMissing: If there is no folder, or it lacks an encoder.
        FormatError: If a file cannot be read.
    """

    def __init__(self, folder: str | Path, threads: int | None = None) -> None:
        self._folder, self._threads = Path(folder), threads
        if not self._folder.is_dir():
            raise FileMissing(f"{folder}: there is no such folder with encoders")
        self._image_file = self._found(_IMAGE_FILES)
        self._text_file = self._found(_TEXT_FILES)
        self.model = f"{self._folder.resolve().name} {_checksum(self._image_file)[:12]}"

    def images(self, images: Sequence[NDArray[np.uint8]]) -> NDArray[np.float32]:
        """Return a unit vector for each RGB image, uint8, (H, W, 3); shape (N, D).

        An image is scaled to the encoder's size, whatever its sides are, so that all of it counts.

        Raises:
            FormatError: If the encoder fails.
        """
        session = self._images
        ready = np.stack([self._prepared(image) for image in images])
        entry = session.get_inputs()[0]
        return _run(session, {entry.name: ready}, self._image_file)

    def texts(self, texts: list[str]) -> NDArray[np.float32]:
        """Return a unit vector for each text, shape (N, D).

        Raises:
            FormatError: If the encoder fails, or the tokenizer cannot be read.
            MissingExtra: If the library that reads tokenizers is not installed.
        """
        session = self._texts
        entries = {entry.name: entry for entry in session.get_inputs()}
        ids = entries.get("input_ids") or next(iter(entries.values()))
        length = ids.shape[1] if isinstance(ids.shape[1], int) else None
        tokens = [self._tokens.of(text, length) for text in texts]
        kind = np.int32 if ids.type == "tensor(int32)" else np.int64
        feed = {ids.name: np.array([one.ids for one in tokens], dtype=kind)}
        if "attention_mask" in entries:
            feed["attention_mask"] = np.array([one.mask for one in tokens], dtype=kind)
        return _run(session, feed, self._text_file)

    @cached_property
    def _images(self) -> Any:
        return open_session(self._image_file, self._threads)

    @cached_property
    def _texts(self) -> Any:
        return open_session(self._text_file, self._threads)

    @cached_property
    def _tokens(self) -> Tokens:
        from hypermap.perception.embedders.tokens import Tokens  # with an optional library

        return Tokens(self._folder)

    @cached_property
    def _preparation(self) -> _Preparation:
        path = self._folder / "preprocessor_config.json"
        values = _json(path) if path.exists() else {}
        shape = self._images.get_inputs()[0].shape
        fixed = [side for side in shape[2:] if isinstance(side, int)]
        try:
            size = (fixed[1], fixed[0]) if len(fixed) == 2 else _size(values)
            mean, deviation = (
                np.array(values.get(key, default), dtype=np.float32).reshape(3)
                for key, default in (("image_mean", _MEAN), ("image_std", _DEVIATION))
            )
        except (TypeError, ValueError, KeyError) as error:
            raise FormatError(f"is not a description of images: {error}", path=path) from None
        if not all(1 <= side <= MAX_SIDE for side in size) or not (deviation > 0).all():
            raise FormatError("the size or the deviation of images is out of range", path=path)
        return _Preparation(size, mean, deviation)

    def _prepared(self, image: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return an image as the encoder takes it, float32, shape (3, rows, columns)."""
        from PIL import Image

        how = self._preparation
        scaled = Image.fromarray(np.ascontiguousarray(image)).resize(
            how.size, Image.Resampling.BICUBIC, reducing_gap=2.0
        )
        values = (np.asarray(scaled, dtype=np.float32) / 255 - how.mean) / how.deviation
        ready: NDArray[np.float32] = values.transpose(2, 0, 1).astype(np.float32)
        return ready

    def _found(self, names: Sequence[str]) -> Path:
        folders = (self._folder, self._folder / "onnx")
        found = [folder / name for name in names for folder in folders if (folder / name).is_file()]
        if not found:
            raise FileMissing(f"{self._folder}: there is no {' or '.join(names)} in it")
        return found[0]


def _run(session: Any, feed: Mapping[str, NDArray[Any]], path: Path) -> NDArray[np.float32]:
    """Return the vectors of an encoder, at length 1.

    Raises:
        FormatError: If it fails, or answers anything but one finite vector for each input.
    """
    try:
        outputs = session.run(None, dict(feed))
    except MemoryError:
        raise
    except Exception as error:  # ONNX Runtime's errors have no common class of their own
        reason = str(error).split("failed:")[-1].strip().partition("\n")[0]
        raise FormatError(f"the encoder fails: {reason}", path=path) from error
    named = dict(zip((one.name for one in session.get_outputs()), outputs, strict=True))
    count = len(next(iter(feed.values())))
    flat = {name: array for name, array in named.items() if np.shape(array)[:1] == (count,)}
    flat = {name: array for name, array in flat.items() if array.ndim == 2}
    chosen = next((flat[name] for name in _OUTPUTS if name in flat), None)
    if chosen is None and len(flat) == 1:
        (chosen,) = flat.values()
    if chosen is None or not 0 < chosen.shape[1] <= MOST_NUMBERS or not np.isfinite(chosen).all():
        raise FormatError(
            f"the encoder answers {', '.join(named)}; expected one vector of up to {MOST_NUMBERS} "
            f"finite numbers, called {' or '.join(_OUTPUTS)}",
            path=path,
        )
    return unit_vectors(chosen.astype(np.float32))


def _checksum(path: Path) -> str:
    checksum = hashlib.sha256()
    with path.open("rb") as file:
        while part := file.read(2**20):
            checksum.update(part)
    return checksum.hexdigest()


def _size(values: Mapping[str, Any]) -> tuple[int, int]:
    """Return columns and rows of the images that an encoder was trained with."""
    size = values.get("crop_size", values.get("size", _SIDE))
    if isinstance(size, Mapping):
        side = size.get("shortest_edge")
        return int(size.get("width", side)), int(size.get("height", side))
    return int(size), int(size)


def _json(path: Path) -> dict[str, Any]:
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise FormatError(f"cannot be read: {error}", path=path) from None
    if not isinstance(values, dict):
        raise FormatError("is not a JSON object", path=path)
    return values
