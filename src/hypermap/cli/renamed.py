"""Deprecated option names: accepted for one more release, with a warning."""

from __future__ import annotations

import functools
import inspect
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, get_args

import typer

from hypermap.cli.added_options import with_options
from hypermap.core.errors import HypermapError, did_you_mean

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Renamed:
    """An option that has another name now.

    Attributes:
        old: how it was declared.
        argument: the argument of the command that it fills.
        new: what to write in its place.
        values: what its texts mean now, where the option has become a switch.
    """

    old: tuple[str, ...]
    argument: str
    new: str
    values: Mapping[str, bool] | None = None

    def value(self, given: Any) -> Any:
        """Return what is given under the old name as the argument takes it now."""
        if self.values is None:
            return given
        if given not in self.values:
            names = did_you_mean(given, self.values)
            raise HypermapError(f"{self.old[0]}: there is no {given!r}; {names}")
        return self.values[given]


RENAMED = {
    "bench": [Renamed(("--json",), "times", "--times")],
    "demo": [
        Renamed(("-o", "--output"), "folder", "--folder"),
        Renamed(("--detector",), "noisy", "--noisy", {"network": False, "noisy": True}),
    ],
    "map": [Renamed(("--evidence/--no-evidence",), "evidence", "--keep-evidence, --drop-evidence")],
    "render": [Renamed(("--labels/--no-labels",), "labels", "--show-labels, --hide-labels")],
    "rviz": [Renamed(("--config",), "output", "-o")],
    "simulate": [Renamed(("--size",), "image_size", "--image-size")],
}
"""By command."""


def takes_old_names(name: str, command: Callable[..., None]) -> Callable[..., None]:
    """Add to a command, hidden from its help, its options' old names."""
    renamed = RENAMED.get(name, ())

    @functools.wraps(command)
    def wrapper(**arguments: Any) -> None:
        for option in renamed:
            given = arguments.pop(_old(option))
            if given is not None:
                spelled = ", ".join(option.old).replace("/", ", ")
                _log.warning("%s: a deprecated name; use %s", spelled, option.new)
                arguments[option.argument] = option.value(given)
        command(**arguments)

    signature = inspect.signature(command, eval_str=True)
    own = list(signature.parameters.values())
    added = [_parameter(option, signature.parameters[option.argument]) for option in renamed]
    return with_options(wrapper, own + added)


def _old(option: Renamed) -> str:
    return f"old_{option.argument}"


def _parameter(option: Renamed, new: inspect.Parameter) -> inspect.Parameter:
    kind = get_args(new.annotation)[0] if option.values is None else str
    declared = typer.Option(*option.old, hidden=True)
    return inspect.Parameter(
        _old(option),
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=Annotated[kind | None, declared],
    )
