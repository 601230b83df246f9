"""What the Tab key offers in the shell."""

from __future__ import annotations

from collections.abc import Iterable

from prompt_toolkit.completion import CompleteEvent, Completer, Completion, PathCompleter
from prompt_toolkit.document import Document

from hypermap.console.commands import COMMANDS, Console
from hypermap.core.semantic import SemanticLayer


class ConsoleCompleter(Completer):
    """Completes commands, then layers, names of objects and files, where each belongs."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._files = PathCompleter(expanduser=True)

    def get_completions(
        self, document: Document, complete_event: CompleteEvent
    ) -> Iterable[Completion]:
        """Yield what the word before the cursor may become."""
        *before, word = [*document.text_before_cursor.split(" ")]
        expected = _expected(before)
        if expected == "FILE":
            yield from self._files.get_completions(Document(word), complete_event)
            return
        for choice in self._choices(expected, before):
            if choice.startswith(word):
                yield Completion(_quoted(choice), -len(word), display=choice)

    def _choices(self, expected: str, before: list[str]) -> Iterable[str]:
        if expected == "COMMAND":
            return COMMANDS
        layers = {layer.name: layer for layer in self._console.hypermap.layers}
        if expected == "LAYER":
            return layers
        layer = layers.get(before[1]) if expected == "STRING" else None
        if isinstance(layer, SemanticLayer):
            return sorted(set(layer.names))
        return ["Free", "Occupied", "Unknown"] if layer is not None else ()


def _expected(before: list[str]) -> str:
    """Return which kind of word comes next, as the help calls it."""
    if not before:
        return "COMMAND"
    words = COMMANDS[before[0]].words.split() if before[0] in COMMANDS else []
    return words[len(before) - 1] if len(before) <= len(words) else ""


def _quoted(word: str) -> str:
    return f'"{word}"' if " " in word else word
