"""Detections in a JSON file, computed once and used many times.

```json
{"image_size": [640, 480],
 "frames": {"1305031229.729064": [{"box": [39.27, 1.14, 383.37, 199.65], "name": "tv", "score": 0.7,
                                   "mask": {"size": [480, 640], "counts": [12345, 6, ...]}}]}}
```

A frame's key is the stamp of its color image [s], `box` is xmin, ymin, xmax, ymax in pixels; the
mask, in COCO's uncompressed or compressed form, may be left out.
"""

from __future__ import annotations

import logging
import math
from bisect import bisect_left, insort
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    BaseModel,
    Field,
    NonNegativeInt,
    ValidationError,
    field_validator,
    model_validator,
)

from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError
from hypermap.core.outside import write_file
from hypermap.core.stamps import in_seconds
from hypermap.perception.detections import Detections
from hypermap.perception.detectors import rle

logger = logging.getLogger(__name__)

STAMP_TOLERANCE = 1e-3  # [s]; stamps written as text are rounded
_ELSEWHERE = 3600.0  # [s] before or after all others, from which on a stamp is of another recording
MAX_BYTES = 1 << 30
MAX_SIDE = 1 << 14  # [pixels] of an image

_SHAPE = '{"frames": {STAMP: [{"box": [xmin, ymin, xmax, ymax], "name": "cup", "score": 0.9}]}}'

_Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
_Coordinate = Annotated[float, Field(ge=-MAX_SIDE, le=2 * MAX_SIDE, allow_inf_nan=False)]


class _Mask(BaseModel, strict=True):
    size: tuple[_Side, _Side]
    counts: list[NonNegativeInt]

    @field_validator("counts", mode="before")
    @classmethod
    def _expand(cls, counts: Any) -> Any:
        return rle.from_text(counts) if isinstance(counts, str) else counts

    @model_validator(mode="after")
    def _check(self) -> _Mask:
        if sum(self.counts) != math.prod(self.size):
            raise ValueError(
                f"the counts add up to {sum(self.counts)}, "
                f"not to {self.size[0]} x {self.size[1]} pixels"
            )
        return self


class _Object(BaseModel, strict=True):
    box: tuple[_Coordinate, _Coordinate, _Coordinate, _Coordinate]
    name: Annotated[str, Field(min_length=1)]
    score: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
    mask: _Mask | None = None

    @model_validator(mode="after")
    def _check(self) -> _Object:
        xmin, ymin, xmax, ymax = self.box
        if xmax < xmin or ymax < ymin:
            raise ValueError(f"expected xmin <= xmax and ymin <= ymax, got {list(self.box)}")
        return self


class _File(BaseModel, strict=True):
    image_size: tuple[_Side, _Side] | None = None
    frames: dict[str, list[_Object]]


class RecordedDetections:
    """The detections of many images, looked up by the images' stamps.

    Attributes:
        image_size: columns and rows of the images; None if not known.
        path: their file; None if they do not come from a file.
        missed: number of lookups with an unknown stamp.
    """

    def __init__(
        self, image_size: tuple[int, int] | None = None, path: str | Path | None = None
    ) -> None:
        self.image_size = image_size
        self.path = path
        self.missed = 0
        self._stamps: list[float] = []
        self._objects: dict[float, list[_Object]] = {}

    def __len__(self) -> int:
        """Return the number of images, with detections or without."""
        return len(self._stamps)

    @property
    def stamps(self) -> tuple[float, ...]:
        """The images' stamps in order [s]."""
        return tuple(self._stamps)

    @property
    def _span(self) -> float:
        return self._stamps[-1] - self._stamps[0]

    @classmethod
    def load(cls, path: str | Path) -> RecordedDetections:
        """Return the detections in a file.

        Raises:
            FileMissing: If there is no such file.
            FormatError: If it does not contain detections; names the frame and the object.
        """
        path = Path(path)
        if not path.is_file():
            raise FileMissing(f"{path}: there is no such file of detections")
        if path.stat().st_size > MAX_BYTES:
            raise FormatError(f"detections take at most {MAX_BYTES} bytes", path=path)
        try:
            text = path.read_text(encoding="utf-8-sig")
            content = _File.model_validate_json(text)
        except UnicodeDecodeError:
            raise FormatError(NOT_UTF8, path=path) from None
        except ValidationError as error:
            first = error.errors()[0]
            raise FormatError(_problem(first), path=path, key=_key_of(first["loc"])) from error
        if _is_normalized(content):
            raise FormatError(
                "all boxes are between 0 and 1; multiply them by the size of the images, as boxes "
                "are in pixels",
                path=path,
            )

        recorded = cls(content.image_size, path)
        numbers = np.array([_number(key, path) for key in content.frames], float)
        stamps = dict(zip(content.frames, in_seconds(numbers).tolist(), strict=True))
        key = ""
        try:
            for key, objects in content.frames.items():
                recorded._put(stamps[key], objects)
        except ValueError as error:
            raise FormatError(str(error), path=path, key=f"frame {key}") from error
        return recorded

    def add(self, stamp: float, detections: Detections) -> None:
        """Add the detections of an image.

        Raises:
            ValueError: If the stamp is already known, or a mask does not have the image's size.
        """
        objects = []
        for i, name in enumerate(detections.names):
            mask = None if detections.masks is None else detections.masks[i]
            # By way of text, a float32 becomes the shortest number for it.
            xmin, ymin, xmax, ymax, score = (
                float(str(value)) for value in (*detections.xyxy[i], detections.scores[i])
            )
            objects.append(
                _Object(
                    box=(xmin, ymin, xmax, ymax),
                    name=name,
                    score=score,
                    mask=None if mask is None else _Mask(size=mask.shape, counts=rle.encode(mask)),
                )
            )
        self._put(stamp, objects)

    def at(self, stamp: float) -> Detections:
        """Return the detections of the image nearest in time, within a millisecond.

        There are none for an unknown stamp; the first such stamp is logged, all are counted.

        Raises:
            FormatError: If it is hours before or after all that are known.
        """
        if self._stamps and not -_ELSEWHERE < stamp - self._stamps[0] < self._span + _ELSEWHERE:
            raise FormatError(
                f"has detections of {self._stamps[0]:.6f} to {self._stamps[-1]:.6f} s, but the "
                f"image is of {stamp:.6f} s; are they of another recording?",
                path=self.path or "detections",
            )
        position = bisect_left(self._stamps, stamp)
        near = self._stamps[max(0, position - 1) : position + 1]
        nearest = min(near, key=lambda known: abs(known - stamp), default=math.inf)
        if abs(nearest - stamp) <= STAMP_TOLERANCE:
            return _as_detections(self._objects[nearest])
        if not self.missed:
            there = f", the nearest is at {nearest:.6f}" if near else ""
            logger.warning(
                "%s: no entry for the image at %.6f%s; this and other missing images count as "
                "images without objects",
                self.path or "detections",
                stamp,
                there,
            )
        self.missed += 1
        return Detections.of([], [])

    def save(self, path: str | Path) -> None:
        """Write what `load` reads; an existing file is replaced atomically.

        Raises:
            FileMissing: If the folder does not exist.
            HypermapError: If it cannot be written.
        """
        frames = {repr(stamp): self._objects[stamp] for stamp in self._stamps}
        content = _File(image_size=self.image_size, frames=frames)
        write_file(path, content.model_dump_json(exclude_none=True).encode())

    def _put(self, stamp: float, objects: list[_Object]) -> None:
        if not math.isfinite(stamp):
            raise ValueError(f"the stamp must be a finite number, got {stamp}")
        if stamp in self._objects:
            raise ValueError(f"there is a frame with the stamp {stamp!r} already")
        masked = [found.mask.size for found in objects if found.mask is not None]
        if masked and len(masked) < len(objects):
            raise ValueError("either all objects of a frame have a mask, or none")
        expected = self.image_size[::-1] if self.image_size else masked[0] if masked else None
        for size in masked:
            if size != expected:
                raise ValueError(f"expected masks of {expected} rows and columns, got {size}")
        insort(self._stamps, stamp)
        self._objects[stamp] = objects


def _as_detections(objects: list[_Object]) -> Detections:
    masks = [rle.decode(found.mask.counts, *found.mask.size) for found in objects if found.mask]
    return Detections.of(
        [found.box for found in objects],
        [found.name for found in objects],
        [found.score for found in objects],
        np.stack(masks) if masks else None,
    )


def _is_normalized(content: _File) -> bool:
    """Return whether boxes seem to be shares of the image's size: none reaches beyond 1."""
    boxes = [found.box for objects in content.frames.values() for found in objects]
    sides = {side for box in boxes for side in box}
    is_share = bool(sides) and min(sides) >= 0 and max(sides) <= 1
    return is_share and not sides <= {0.0, 1.0}  # which may be whole pixels


def _number(key: str, path: Path) -> float:
    try:
        return float(key)
    except ValueError:
        raise FormatError(
            "the key of a frame is its stamp in seconds", path=path, key=f"frame {key}"
        ) from None


def _problem(error: Mapping[str, Any]) -> str:
    """Return what is wrong, in words."""
    message = str(error["msg"]).removeprefix("Value error, ")
    if error["loc"] in ((), ("frames",)) and error["type"] != "json_invalid":
        message += f"; expected {_SHAPE}; docs/detectors.md shows how to convert COCO results"
    elif error["type"] == "missing" and error["loc"][-1] in ("box", "name", "score"):
        message += "; an object has box, name and score"
    return message


def _key_of(location: tuple[Any, ...]) -> str | None:
    """Return the place of an error, in words."""
    match location:
        case ("frames", stamp, int(number), *rest):
            return ": ".join([f"frame {stamp}", f"object {number}", *map(str, rest)])
        case ("frames", stamp, *_):
            return f"frame {stamp}"
    return ".".join(map(str, location)) or None
