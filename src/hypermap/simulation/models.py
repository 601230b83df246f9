"""Models of what can stand in a world, by name."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping

from hypermap.core.errors import did_you_mean
from hypermap.simulation import furniture, things
from hypermap.simulation.parts import Part

MAX_SIZE = 20.0  # meters

Model = Callable[..., tuple[Part, ...]]


def build(model: str, size: Mapping[str, float], color: str | None) -> tuple[Part, ...]:
    """Return the parts of a model at its origin.

    Args:
        model: a key of `MODELS`.
        size: the model's size parameters [m] that differ from its defaults.
        color: of its main parts, as "#b5835a" or "teal"; None for the model's own.

    Raises:
        ValueError: If the model, a parameter or the color is unknown, or a size is out of range.
    """
    if model not in MODELS:
        raise ValueError(f"unknown model {model!r}; {did_you_mean(model, MODELS)}")
    known = size_parameters(model)
    for key, value in size.items():
        if key not in known:
            raise ValueError(f"{model} has no size {key!r}; {did_you_mean(key, known)}")
        if not 0 < value <= MAX_SIZE:
            raise ValueError(f"{key} must lie above 0 and at most at {MAX_SIZE:g} m, got {value}")
    return MODELS[model](*(() if color is None else (color,)), **size)


def size_parameters(model: str) -> dict[str, float]:
    """Return the size parameters of a model and their defaults [m]."""
    parameters = inspect.signature(MODELS[model]).parameters.values()
    return {p.name: p.default for p in parameters if p.kind is p.KEYWORD_ONLY}


MODELS: Mapping[str, Model] = {
    model.__name__: model
    for model in (
        furniture.chair,
        furniture.table,
        things.cup,
        things.monitor,
        things.person,
        things.plant,
        furniture.sofa,
        furniture.sink,
        furniture.cupboard,
        furniture.lamp,
        furniture.bench,
        furniture.bin,
        furniture.noteboard,
        furniture.panel,
        things.screen,
        things.keyboard,
        things.mouse,
        things.fan,
        things.sitter,
        furniture.shelf,
        furniture.bed,
        things.bottle,
        things.carton,
    )
}
