"""The names of a network's classes."""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError
from hypermap.simple_yaml import parse_simple_yaml

MAX_BYTES = 1_000_000  # Objects365 and LVIS need some 30 kB

_COCO = """
    person, bicycle, car, motorcycle, airplane, bus, train, truck, boat, traffic light, fire
    hydrant, stop sign, parking meter, bench, bird, cat, dog, horse, sheep, cow, elephant, bear,
    zebra, giraffe, backpack, umbrella, handbag, tie, suitcase, frisbee, skis, snowboard, sports
    ball, kite, baseball bat, baseball glove, skateboard, surfboard, tennis racket, bottle, wine
    glass, cup, fork, knife, spoon, bowl, banana, apple, sandwich, orange, broccoli, carrot, hot
    dog, pizza, donut, cake, chair, couch, potted plant, bed, dining table, toilet, tv, laptop,
    mouse, remote, keyboard, cell phone, microwave, oven, toaster, sink, refrigerator, book,
    clock, vase, scissors, teddy bear, hair drier, toothbrush
"""
COCO = tuple(" ".join(name.split()) for name in _COCO.split(","))


def read_labels(path: str | Path) -> tuple[str, ...]:
    """Return the class names in a file; `coco` means the 80 of COCO.

    YAML and JSON (.yaml, .yml, .json) contain a list, a mapping from number to name, or either
    under the key `names`, as in the data files of YOLO. Any other file has one name per line.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it contains something else.
    """
    if str(path) == "coco":
        return COCO
    path = Path(path)
    if not path.is_file():
        raise FileMissing(f"{path}: there is no such file of labels")
    if path.stat().st_size > MAX_BYTES:
        raise FormatError(f"labels take at most {MAX_BYTES} bytes", path=path)
    try:
        text = path.read_text(encoding="utf-8-sig")
        if path.suffix.lower() not in (".yaml", ".yml", ".json"):
            return _as_names(text.rstrip().split("\n"))
        content = json.loads(text) if path.suffix.lower() == ".json" else parse_simple_yaml(text)
        return _as_names(content["names"] if _has_names(content) else content)
    except UnicodeDecodeError:
        raise FormatError(NOT_UTF8, path=path) from None
    except (ValueError, RecursionError) as error:
        reason = str(error).replace("\n", " ")
        raise FormatError(f"not a file of labels: {reason}", path=path) from error


def parse_names(literal: str) -> tuple[str, ...]:
    """Return the names in the metadata of a model: a Python list, or mapping from number to name.

    Raises:
        ValueError: If it contains something else.

    >>> parse_names("{0: 'cup', 1: 'bowl'}")
    ('cup', 'bowl')
    """
    return _as_names(parse_literal(literal))


def parse_literal(text: str) -> Any:
    """Return the value of a Python literal; nothing is executed.

    Raises:
        ValueError: If it is not a literal, or too long.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(f"longer than {MAX_BYTES} characters")
    try:
        return ast.literal_eval(text)
    except (SyntaxError, ValueError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(f"expected a Python literal, got {text[:60]!r}") from error


def _has_names(content: Any) -> bool:
    return isinstance(content, Mapping) and "names" in content


def _as_names(content: Any) -> tuple[str, ...]:
    if isinstance(content, Mapping):
        numbers = sorted(content) if all(isinstance(key, int) for key in content) else []
        if numbers != list(range(len(content))):
            raise ValueError(f"classes must be numbered from 0 to {len(content) - 1}")
        content = [content[number] for number in numbers]
    if not isinstance(content, list | tuple) or not content:
        raise ValueError("expected a list of names, or a mapping from number to name")
    for number, name in enumerate(content):
        if not isinstance(name, str) or not name.strip():
            raise ValueError(f"the name of class {number} is {name!r}; expected words")
    return tuple(name.strip() for name in content)
