"""Adds options to commands: typer reads them from a command's signature."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence


def with_options(
    command: Callable[..., None], parameters: Sequence[inspect.Parameter]
) -> Callable[..., None]:
    """Return a command that takes these parameters, as far as typer can see.

    Args:
        command: takes any keyword arguments.
        parameters: annotated as typer has it.
    """
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in parameters}
    return command
