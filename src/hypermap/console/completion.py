"""What the Tab key offers in the shell."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from prompt_toolkit.completion import CompleteEvent, Completer, Completion, PathCompleter
from prompt_toolkit.document import Document

from hypermap.console.choices import STATES, values_of
from hypermap.console.commands import COMMANDS, Console, split
from hypermap.console.options import OPTIONS, option_of
from hypermap.core.errors import HypermapError
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
        before, word = _words(document.text_before_cursor)
        expected = _expected(before)
        if expected == "FILE":
            yield from self._files.get_completions(Document(word), complete_event)
            return
        for choice in self._choices(expected, before):
            if choice.startswith(word.removeprefix('"')):
                yield Completion(_quoted(choice), -len(word), display=choice)

    def _choices(self, expected: str, before: list[str]) -> Iterable[str]:
        if expected in ("COMMAND", "[COMMAND]"):
            return COMMANDS
        if expected == "OPTION":
            return _options(before)
        if before[0] == "query":
            return values_of(self._console.hypermap, before[-1])
        layers = {layer.name: layer for layer in self._console.hypermap.layers}
        if expected == "LAYER":
            return layers
        layer = layers.get(before[1]) if expected == "STRING" else None
        if isinstance(layer, SemanticLayer):
            return sorted(set(layer.names))
        return STATES if layer is not None else ()


def _words(text: str) -> tuple[list[str], str]:
    """Return the whole words of a line that is being typed, and the part of the last one."""
    quotes = text.count('"')
    start = text.rfind('"') if quotes % 2 else text.rfind(" ") + 1
    try:
        return split(text[:start]), text[start:]
    except HypermapError:  # an escape that is not finished
        return [], text


def _options(before: list[str]) -> Iterator[str]:
    """Yield the options of a question that are not there yet, or may be repeated."""
    for name, option in OPTIONS.items():
        if option.repeats or name not in before:
            yield name


def _expected(before: list[str]) -> str:
    """Return which kind of word comes next, as the help calls it."""
    if not before:
        return "COMMAND"
    if before[0] == "query":
        option = option_of(before[-1])
        return option.takes if option and option.takes else "OPTION"
    words = COMMANDS[before[0]].words.split() if before[0] in COMMANDS else []
    return words[len(before) - 1] if len(before) <= len(words) else ""


def _quoted(word: str) -> str:
    return f'"{word}"' if " " in word else word
