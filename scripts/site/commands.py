"""The command line reference, from the commands themselves."""

from __future__ import annotations

import re
from typing import Any

from typer.main import get_command

from hypermap.cli.main import app

COMMON = {"verbose", "quiet", "help"}  # said once, for all commands


def page() -> str:
    """Return the page: every command with its description, usage, arguments and options."""
    group: Any = get_command(app)
    context = group.make_context("hypermap", [], resilient_parsing=True)
    parts = [
        "# Commands",
        "Generated from the commands, which say the same with `--help`. "
        "[The command line](../docs/command-line.md) goes through them with examples.",
        "Every command takes `-v` (`--verbose`) to tell more on standard error, twice for details, "
        "and `-q` (`--quiet`) to say no more than answers and errors.",
    ]
    for name in group.list_commands(context):
        _, command, _ = group.resolve_command(context, [name])
        if not command.hidden:
            parts += _command(
                command, command.make_context(name, [], parent=context, resilient_parsing=True)
            )
    return "\n\n".join(parts) + "\n"


def _command(command: Any, context: Any) -> list[str]:
    usage = " ".join(["hypermap", command.name, *command.collect_usage_pieces(context)])
    parts = [f"## {command.name}", f"```text\n{usage}\n```", *_prose(command.help)]
    panels: dict[str, list[str]] = {}
    for parameter in command.params:
        record = parameter.get_help_record(context)  # None: hidden
        if record and parameter.name not in COMMON:
            kind = "Arguments" if parameter.param_type_name == "argument" else "Options"
            panel = getattr(parameter, "rich_help_panel", None) or kind
            panels.setdefault(panel, []).append(f"| `{_cell(record[0])}` | {_help(record[1])} |")
    for panel, rows in panels.items():
        parts.append("\n".join([f"| {panel} | |", "| --- | --- |", *rows]))
    return parts


def _prose(text: str) -> list[str]:
    """Return the paragraphs of a command's help, the indented ones as examples."""
    paragraphs = []
    for paragraph in re.sub(r"\[/?bold\]", "**", text).split("\n\n"):
        words, _, examples = paragraph.partition("\n    ")
        paragraphs.append(_help(words))
        if examples:
            lines = "\n".join(line.removeprefix("    ") for line in examples.splitlines())
            paragraphs.append(f"```text\n{lines}\n```")
    return paragraphs


def _help(text: str) -> str:
    """Return text as Markdown: options and file names as code, the rest as it stands."""
    apart = re.split(r"(`[^`]*`)", text)
    for i in range(0, len(apart), 2):
        plain = re.sub(r"([<>_])", r"\\\1", apart[i])
        apart[i] = re.sub(r"(?<![\w-])(--?[a-z][\w-]*)", r"`\1`", plain)
    return _cell("".join(apart))


def _cell(text: str) -> str:
    return text.replace("|", r"\|")
